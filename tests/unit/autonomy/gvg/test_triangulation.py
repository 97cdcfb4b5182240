import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial import Delaunay

from gvgbot.autonomy.gvg.triangulation import Triangulation, delaunay
from gvgbot.geometry import Array


def corners(triangles: NDArray[np.int32]) -> set[tuple[int, ...]]:
    return {tuple(sorted(triangle)) for triangle in triangles.tolist()}


def found(points: Array) -> Triangulation:
    triangulation = delaunay(points)
    assert triangulation is not None
    return triangulation


@pytest.mark.parametrize("seed", range(5))
def test_triangles_are_those_of_qhull(seed: int) -> None:
    points = np.random.default_rng(seed).uniform(-8.0, 8.0, (300, 2))
    triangulation = found(points)
    expected = Delaunay(points)
    flat = corners(triangulation.triangles) ^ corners(expected.simplices)
    on_hull = set(np.unique(expected.convex_hull).tolist())
    assert len(flat) < 5
    assert all(set(triangle) <= on_hull for triangle in flat)  # the hull is no wall: all the same


@pytest.mark.parametrize("seed", range(3))
def test_neighbours_share_the_side_that_lies_opposite_to_a_corner(seed: int) -> None:
    points = np.random.default_rng(seed).uniform(-8.0, 8.0, (50, 2))
    _, triangles, neighbours = found(points)
    for triangle, others in zip(triangles.tolist(), neighbours.tolist(), strict=True):
        for corner, other in zip(triangle, others, strict=True):
            side = set(triangle) - {corner}
            sharing = [k for k, t in enumerate(triangles.tolist()) if side <= set(t)]
            assert {triangles.tolist().index(triangle), other} - {-1} == set(sharing)


def test_triangles_are_counterclockwise() -> None:
    points, triangles, _ = found(np.random.default_rng(1).uniform(-8.0, 8.0, (100, 2)))
    p, q, r = (points[triangles[:, k]] for k in range(3))
    (ax, ay), (bx, by) = (q - p).T, (r - p).T
    assert (ax * by - ay * bx > 0).all()


def test_no_point_of_a_grid_lies_within_the_circle_around_three_others() -> None:
    """Where four are on one circle, either diagonal will do."""
    grid = np.stack(np.meshgrid(np.arange(6.0), np.arange(5.0)), axis=-1).reshape(-1, 2)
    points, triangles, _ = found(grid)
    assert len(triangles) == 2 * 5 * 4
    for triangle in points[triangles]:
        (ax, ay), (bx, by), (cx, cy) = triangle
        sides = np.array([[bx - ax, by - ay], [cx - ax, cy - ay]])
        centre = triangle[0] + np.linalg.solve(2 * sides, (sides**2).sum(axis=1))
        radius = np.hypot(*(triangle[0] - centre))
        assert np.hypot(*(points - centre).T).min() > radius - 1e-9


def test_a_point_that_is_there_twice_is_taken_once() -> None:
    square = np.array([(0.0, 0.0), (2.0, 0.0), (2.0, 1.0), (0.0, 1.0), (2.0, 1.0)])
    points, triangles, _ = found(square)
    assert len(points) == 4
    assert len(triangles) == 2


@pytest.mark.parametrize("count", [0, 1, 2, 3, 9])
def test_points_on_one_line_have_none(count: int) -> None:
    assert delaunay(np.stack([np.arange(count), 2.0 * np.arange(count)], axis=1)) is None
