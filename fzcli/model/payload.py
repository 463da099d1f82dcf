"""A rigid load on a tip, as numbers that come at run time: mass, centre of mass, inertia."""

import casadi as ca

from fzcli.model.algebra import dot, rotate
from fzcli.model.composite import Composite, own_bodies, shifted
from fzcli.model.tree import TipFrame, Tree

Factors = tuple[ca.SX, ca.SX]
PAYLOAD = 10  # mass [kg], CoM in the tip's frame (3) [m], inertia xx yy zz xy xz yz about it, tip axes [kg m2]


def loaded_bodies(tree: Tree, tip: TipFrame, payload: ca.SX, factors: Factors | None = None) -> list[Composite]:
    """Each body in its frame, the base last, the one that carries the tip together with the payload (10).

    ``factors``: of the bodies' masses and of their inertias about their CoM, the base first, (n+1) each.
    """
    parts = own_bodies(tree)
    if factors is not None:
        order = [*range(1, len(parts)), 0]
        parts = [_scaled(part, factors[0][i], factors[1][i]) for part, i in zip(parts, order, strict=True)]
    own, load = parts[tip.body], on_carrier(tip, payload)
    parts[tip.body] = Composite(
        own.mass + load.mass, own.first_moment + load.first_moment, own.tensor + load.tensor
    )
    return parts


def _scaled(part: Composite, mass: ca.SX, inertia: ca.SX) -> Composite:
    """A body of other mass and inertia, its CoM where it was."""
    if not part.mass:
        return Composite(part.mass, part.first_moment, inertia * part.tensor)
    h = part.first_moment
    shift = (dot(h, h) * ca.SX.eye(3) - ca.mtimes(h, h.T)) / part.mass
    return Composite(mass * part.mass, mass * h, inertia * (part.tensor - shift) + mass * shift)


def on_carrier(tip: TipFrame, payload: ca.SX) -> Composite:
    """The payload alone (10), in the frame of the body that carries the tip."""
    at_tip = about_tip(payload)
    R = ca.SX(ca.DM(tip.place.rotation))
    h = rotate(R, at_tip.first_moment)
    place = ca.SX(ca.DM(tip.place.translation))
    tensor = shifted(ca.mtimes(ca.mtimes(R, at_tip.tensor), R.T), h, at_tip.mass, place)
    return Composite(at_tip.mass, h + at_tip.mass * place, tensor)


def about_tip(payload: ca.SX) -> Composite:
    """The payload alone (10), about the tip's origin in its axes."""
    mass, com = payload[0], payload[1:4]
    xx, yy, zz, xy, xz, yz = (payload[i] for i in range(4, PAYLOAD))
    rows = [ca.horzcat(xx, xy, xz), ca.horzcat(xy, yy, yz), ca.horzcat(xz, yz, zz)]
    spread = dot(com, com) * ca.SX.eye(3) - ca.mtimes(com, com.T)
    return Composite(mass, mass * com, ca.vertcat(*rows) + mass * spread)
