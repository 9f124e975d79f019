"""Reads dashboards with Grafana's own model of them, which Grafana's makers generate from its schema for each release
(`grafana-foundation-sdk`, Apache-2.0), and prints as JSON the members that this model lacks or reads differently.

usage: grafana.py DASHBOARD.json...

An unknown member is lost when it is read and written again. A wrong type is found by the model's annotations, down to
each panel's options. A panel type without a model of its own is reported as well.
"""

import enum
import inspect
import json
import sys
import types
import typing

from grafana_foundation_sdk.cog import plugins, runtime
from grafana_foundation_sdk.cog.encoder import JSONEncoder
from grafana_foundation_sdk.models.dashboard import Dashboard


def lost(before, after, path, tell):
    """The members that are lost or changed."""
    if isinstance(before, dict) and isinstance(after, dict):
        for name, value in before.items():
            if name in after:
                lost(value, after[name], f"{path}.{name}", tell)
            else:
                tell(f"{path}.{name}: no such member")
    elif isinstance(before, list) and isinstance(after, list) and len(before) == len(after):
        for place, (one, other) in enumerate(zip(before, after)):
            lost(one, other, f"{path}[{place}]", tell)
    elif before != after:
        tell(f"{path}: {before!r} became {after!r}")


def fits(value, kind):
    """Whether a value is of an annotated type, as far as it does not look into objects."""
    origin, arguments = typing.get_origin(kind), typing.get_args(kind)
    if origin in (typing.Union, types.UnionType):
        return any(fits(value, one) for one in arguments)
    if origin is typing.Literal:
        return value in arguments
    if origin is list:
        return isinstance(value, list) and all(fits(one, arguments[0]) for one in value)
    if origin is dict:
        return isinstance(value, dict) and all(fits(one, arguments[1]) for one in value.values())
    if inspect.isclass(kind) and hasattr(kind, "from_json") and isinstance(value, dict):
        # The model's own reader does not change it.
        told, one = [], kind.from_json(value)
        lost(value, json.loads(JSONEncoder().encode(one)), "", told.append)
        typed(one, "", told.append)
        return not told
    if inspect.isclass(kind) and issubclass(kind, enum.Enum):
        return value in {one.value for one in kind}
    if kind is float:
        return isinstance(value, (int, float)) and not isinstance(value, bool)
    if kind is int:
        return isinstance(value, int) and not isinstance(value, bool)
    if kind is object or kind is typing.Any or isinstance(kind, typing.TypeVar):
        return True
    return isinstance(value, kind)


def typed(value, path, tell):
    """Compares every object of the model with its own annotations."""
    if isinstance(value, list):
        for place, one in enumerate(value):
            typed(one, f"{path}[{place}]", tell)
    elif isinstance(value, dict):
        for name, one in value.items():
            typed(one, f"{path}.{name}", tell)
    elif hasattr(value, "to_json"):
        for name, kind in typing.get_type_hints(type(value).__init__).items():
            member = getattr(value, name, None)
            if name != "return" and not fits(member, kind):
                tell(f"{path}.{name}: {member!r} is no {kind}")
            typed(member, f"{path}.{name}", tell)


def main():
    if len(sys.argv) < 2:
        sys.exit(__doc__)
    plugins.register_default_plugins()
    told, members = [], 0
    for path in sys.argv[1:]:
        with open(path, encoding="utf-8") as file:
            before = json.load(file)
        dashboard = Dashboard.from_json(before)
        lost(before, json.loads(JSONEncoder().encode(dashboard)), before["title"], told.append)
        typed(dashboard, before["title"], told.append)
        for panel in dashboard.panels:
            members += 1
            if panel.type_val != "row" and runtime.panelcfg_config(panel.type_val) is None:
                told.append(f"{before['title']}: there is no panel type {panel.type_val}")
    print(json.dumps({"told": told, "panels": members}))


if __name__ == "__main__":
    main()
