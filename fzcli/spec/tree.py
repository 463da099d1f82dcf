"""Links as a tree: what can be wrong with it, and its depth-first order."""

from collections.abc import Callable, Mapping, Sequence

from fzcli.errors import Problem, SpecError
from fzcli.spec.document import Steps
from fzcli.spec.nearest import hint
from fzcli.spec.robot import Link, Tip

Report = Callable[[str, Steps], Problem]  # message and path, such as ("links", 2, "parent"), to a problem


def arranged(links: Sequence[Link], tips: Mapping[str, Tip], report: Report) -> tuple[Link, ...]:
    """The links depth first from the base, children in the order of the file.

    Raises:
        SpecError: names that stand twice, unknown parents, links in a loop, tips on unknown links, or
            no joint that moves.
    """
    problems = _doubled(links, report)
    if not problems:
        problems = _parents(links, report) + _tips(links, tips, report)
        if all(link.joint.type == "fixed" for link in links):
            problems.append(report("no joint moves: at least one must not be fixed", ("links",)))
    if problems:
        raise SpecError(problems)
    return _depth_first(links)


def _doubled(links: Sequence[Link], report: Report) -> list[Problem]:
    problems = []
    seen: set[tuple[str, ...]] = set()
    for index, link in enumerate(links):
        for key in ((link.name,), ("joint", link.joint.name)):
            if key in seen:
                what = "joint" if len(key) == 2 else "link"
                steps = ("links", index, *key[:-1], "name")
                problems.append(report(f"{what} '{key[-1]}' stands twice", steps))
            seen.add(key)
    return problems


def _parents(links: Sequence[Link], report: Report) -> list[Problem]:
    parents = {link.name: link.parent for link in links}
    indices = {link.name: index for index, link in enumerate(links)}
    known = {"base": None, **parents}
    problems = []
    for index, link in enumerate(links):
        if link.parent not in known:
            text = f"unknown parent '{link.parent}'{hint(link.parent, known, 'known links')}"
            problems.append(report(text, ("links", index, "parent")))
    settled: set[str] = set()
    for link in links:
        way: dict[str, None] = {}  # the links towards the base, in order
        name = link.name
        while name in parents and name not in settled and name not in way:
            way[name] = None
            name = parents[name]
        if name in way:
            loop = list(way)[list(way).index(name) :]
            text = f"links form a loop: {' -> '.join([*loop, name])} (each is carried by the next)"
            problems.append(report(text, ("links", indices[name], "parent")))
        settled.update(way)
    return problems


def _tips(links: Sequence[Link], tips: Mapping[str, Tip], report: Report) -> list[Problem]:
    names = {link.name: None for link in links}
    return [
        report(f"unknown link '{tip.link}'{hint(tip.link, names, 'known links')}", ("tips", name, "link"))
        for name, tip in tips.items()
        if tip.link not in names
    ]


def _depth_first(links: Sequence[Link]) -> tuple[Link, ...]:
    children: dict[str, list[Link]] = {}
    for link in links:
        children.setdefault(link.parent, []).append(link)
    waiting = children.get("base", [])[::-1]
    order = []
    while waiting:
        link = waiting.pop()
        order.append(link)
        waiting += children.get(link.name, [])[::-1]
    return tuple(order)
