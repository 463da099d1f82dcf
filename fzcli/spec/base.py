"""The base of every spec model: frozen, closed to unknown keys."""

from typing import Any

from pydantic import BaseModel, ConfigDict


class SpecModel(BaseModel):
    """A frozen pydantic model that refuses unknown keys and values that are not finite."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False, populate_by_name=True)

    def value_at(self, path: str) -> Any:
        """The value at a dotted path, e.g. ``value_at("controller.gain")``; KeyError when there is none."""
        value: Any = self
        for key in path.split("."):
            if isinstance(value, dict):
                value = value[key]
            elif isinstance(value, list | tuple):
                value = value[int(key)]
            elif isinstance(value, BaseModel) and key in type(value).model_fields:
                value = getattr(value, key)
            else:
                raise KeyError(path)
        return value

    def has(self, path: str) -> bool:
        """Whether there is a value at a dotted path."""
        try:
            self.value_at(path)
        except (KeyError, IndexError, ValueError):
            return False
        return True
