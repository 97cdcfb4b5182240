"""A robot in the browser: a small server on top of `gvgbot.client`, and the page that it serves."""
