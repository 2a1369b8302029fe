"""Single layers on panels against quadrature with many graded points, and their flow against forces all around."""

import numpy as np
import pytest

from spirillum.fluid.wire.sources import Panels
from spirillum.kernels.core import add_layer, ring_blocks

MODES = 4
RULE = 2e-6
"""Error of the kernel's own quadrature, over the largest number."""


@pytest.fixture(scope="module")
def panels() -> Panels:
    """Two of a slightly bent outline."""
    nodes = 0.5 * np.polynomial.legendre.leggauss(6)[0]
    x = np.array([nodes, nodes + 1.0])
    return Panels(x, 0.8 - 0.1 * x**2, np.zeros(2, dtype=int))


def graded(towards: float) -> tuple[np.ndarray, np.ndarray]:
    """Points and weights on [-1, 1] in Gauss pieces that shrink by half towards a point."""
    nodes, weights = np.polynomial.legendre.leggauss(20)
    edges = np.unique(np.clip([towards + s * 2.0**n for n in range(-45, 2) for s in (-1, 1)] + [towards], -1, 1))
    half = 0.5 * np.diff(edges)[:, None]
    return (edges[:-1, None] + half * (1 + nodes)).ravel(), (half * weights).ravel()


def by_quadrature(panels: Panels, panel: int, x: float, rho: float, towards: float, e2: float) -> np.ndarray:
    """Velocities of unit densities on the nodes of one panel, (modes, 3, p, 3)."""
    u, weights = graded(towards)
    nodes = panels.rule[0]
    others = [np.delete(nodes, j) for j in range(nodes.size)]
    cardinal = np.stack([np.prod((u[:, None] - o) / (t - o), axis=1) for t, o in zip(nodes, others, strict=True)], 1)
    x_s, rho_s = cardinal @ panels.x[panel], cardinal @ panels.rho[panel]
    blocks = np.empty((MODES, 1, 3, u.size, 3))
    ring_blocks(np.array([x]), np.array([rho]), x_s, rho_s, e2, blocks)
    return np.einsum("q,mcqd,qj->mcjd", weights * rho_s, blocks[:, 0], cardinal)


@pytest.mark.parametrize("e2", [0.0, 1e-4])
def test_layers_on_a_node_close_and_far(panels: Panels, e2: float) -> None:
    x, rho = panels.x.ravel(), panels.rho.ravel()
    own = panels.velocities(x, rho, MODES, e2, on_nodes=True).reshape(MODES, x.size, 3, 2, 6, 3)
    off = panels.velocities(x, rho + 0.02, MODES, e2).reshape(own.shape)
    for node in (0, 3, 7):
        for panel in range(2):
            towards = np.interp(x[node], panels.x[panel], panels.rule[0])
            wanted = by_quadrature(panels, panel, x[node], rho[node], towards, e2)
            np.testing.assert_allclose(own[:, node, :, panel], wanted, rtol=0, atol=RULE * np.abs(wanted).max())
            wanted = by_quadrature(panels, panel, x[node], rho[node] + 0.02, towards, e2)
            np.testing.assert_allclose(off[:, node, :, panel], wanted, rtol=0, atol=RULE * np.abs(wanted).max())


def test_the_flow_of_a_layer_is_that_of_forces_all_around(panels: Panels) -> None:
    """Forces f exp(i m theta), with f_theta = i g, at many angles; p = 2 x.f/r^3."""
    rng = np.random.default_rng(7)
    density = rng.normal(size=(2, 6, MODES, 3)) + 1j * rng.normal(size=(2, 6, MODES, 3))
    points = np.array([[0.3, 2.0, 1.0], [0.2, -0.1, 0.2], [-3.0, 0.3, -0.4], [0.5, 0.6, 0.6]])
    field = np.zeros((4, 4))
    add_layer(points, panels.x, panels.rho, density, *panels.rule, field)
    theta = 2 * np.pi * np.arange(400) / 400
    fine, weights = np.polynomial.legendre.leggauss(60)
    cardinal = panels.cardinals(fine)
    wanted = np.zeros((4, 4))
    for x_p, rho_p, modes in zip(panels.x, panels.rho, density, strict=True):
        x, rho = cardinal @ x_p, cardinal @ rho_p
        turned = np.einsum("qj,jmd,mt->qtd", cardinal, modes, np.exp(1j * np.arange(MODES)[:, None] * theta))
        turned *= (weights * rho)[:, None, None] * 2 * np.pi / theta.size
        along, out, around = turned[..., 0].real, turned[..., 1].real, (1j * turned[..., 2]).real
        c, s = np.cos(theta), np.sin(theta)
        forces = np.stack([along, out * c - around * s, out * s + around * c], axis=-1)
        places = np.stack([x[:, None] + 0 * theta, rho[:, None] * c, rho[:, None] * s], axis=-1)
        r = points[:, None, None] - places
        size, dot = np.linalg.norm(r, axis=-1)[..., None], np.sum(r * forces, axis=-1)[..., None]
        wanted[:, :3] += np.sum(forces / size + r * dot / size**3, axis=(1, 2))
        wanted[:, 3] += np.sum(2 * dot / size**3, axis=(1, 2, 3))
    np.testing.assert_allclose(field, wanted, rtol=0, atol=RULE * np.abs(wanted).max())
