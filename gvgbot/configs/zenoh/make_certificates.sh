#!/bin/sh
# Makes the certificates of robot_tls.json5 and client_tls.json5 in a directory: an authority, one
# for the robot with the names by which it is reached, one for each person or program.
#
#   make_certificates.sh DIRECTORY ROBOT_NAMES PERSON...
#   make_certificates.sh certificates robot.local,192.168.1.7 operator monitor
#
# An authority that is there already is used again, so that more people can be added later. Give
# ca.crt to everybody, each .crt and .key to its owner, and keep ca.key where no robot is.
set -eu
if [ $# -lt 3 ]; then
  echo "usage: $0 DIRECTORY ROBOT_NAMES PERSON..." >&2
  exit 2
fi
command -v openssl >/dev/null || { echo "$0: openssl is needed: apt install openssl" >&2; exit 1; }
directory=$1 names=$2
shift 2
umask 077
mkdir -p "$directory"
cd "$directory"
days=3650

if [ ! -e ca.key ]; then
  openssl req -x509 -newkey ec -pkeyopt ec_paramgen_curve:prime256v1 -nodes -days $days \
    -subj "/CN=gvgbot authority" -keyout ca.key -out ca.crt 2>/dev/null
fi

# issue NAME EXTENSIONS: NAME.key and NAME.crt, whose common name is NAME
issue() {
  printf '%s\n' "basicConstraints=CA:FALSE" "$2" > "$1.ext"
  openssl req -newkey ec -pkeyopt ec_paramgen_curve:prime256v1 -nodes \
    -subj "/CN=$1" -keyout "$1.key" -out "$1.csr" 2>/dev/null
  openssl x509 -req -in "$1.csr" -CA ca.crt -CAkey ca.key -CAcreateserial -days $days \
    -extfile "$1.ext" -out "$1.crt" 2>/dev/null
  rm "$1.ext" "$1.csr"
  echo "$directory/$1.crt"
}

alternatives=
for name in $(echo "$names" | tr , ' '); do
  case $name in
    *:*) kind=IP ;;
    *[!0-9.]*) kind=DNS ;;
    *) kind=IP ;;
  esac
  alternatives="$alternatives${alternatives:+,}$kind:$name"
done
if [ -e robot.crt ]; then
  echo "$directory/robot.crt: kept; for other names remove it and run this again"
else
  issue robot "subjectAltName=$alternatives"
fi
for person in "$@"; do
  issue "$person" "extendedKeyUsage=clientAuth"
done
