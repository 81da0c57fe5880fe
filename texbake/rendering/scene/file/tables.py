"""Tables of a scene file, derived from the classes that they become.

Each key is a field of its class, with the same default, so that files can express everything the
class can hold and no default is written twice. pydantic validates the keys and builds the class in
the same pass, so that errors of the class are reported with their place in the file.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import is_dataclass
from functools import cache
from typing import Annotated, Any, ClassVar, get_args, get_origin

from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    Field,
    GetJsonSchemaHandler,
    ValidatorFunctionWrapHandler,
    WithJsonSchema,
    WrapValidator,
    create_model,
    model_validator,
)
from pydantic.json_schema import GenerateJsonSchema
from pydantic_core import CoreSchema

from texbake.errors import quoted
from texbake.rendering.scene.file.values import (
    Color,
    Colors,
    Number,
    Plain,
    Switch,
    Text,
    Whole,
    choice,
    format_value,
    key_error,
    nearest,
    numbers,
    validation_error,
)
from texbake.schema import JsonSchema, OptionField, option_fields

# Types of keys by name, for fields whose own type is not specific enough.
_BY_NAME: dict[str, Any] = {"color": Color, "ground": Color, "colors": Colors}
_BY_KIND: dict[Any, Any] = {float: Number, int: Whole, bool: Switch, str: Text}
# Types of keys by all types that a field can have, such as those of a slot.
_BY_KINDS: dict[tuple[Any, ...], Any] = {}


def read_as(kinds: tuple[Any, ...], key_type: Any) -> None:
    """Let fields of these types, whatever their class, be read as a type of keys."""
    _BY_KINDS[kinds] = key_type


class Table(BaseModel):
    """A table whose keys are checked one by one."""

    model_config = ConfigDict(extra="ignore", arbitrary_types_allowed=True)
    source: ClassVar[type | None] = None  # the class whose fields are the keys
    # Key that is set by a plain value in place of the table; None if a table is required
    short: ClassVar[str | None] = None
    # Whether `true` is accepted as an empty table, and `false` as none; see `switchable_by`
    switchable: ClassVar[bool] = False
    takes_more: ClassVar[bool] = False  # whether unknown keys are kept
    further_keys: ClassVar[JsonSchema] = {}  # JSON Schemas of unknown keys

    @model_validator(mode="before")
    @classmethod
    def _check_keys(cls, value: Any) -> Any:
        if value is True and cls.switchable:
            value = {}
        if not isinstance(value, dict):
            if cls.short is None:
                raise validation_error(
                    f"{format_value(value)} is not a table; its keys are {', '.join(cls.keys())}"
                )
            value = {cls.short: value}
        if not cls.takes_more:
            for key in value:
                if key not in cls.model_fields:
                    raise key_error(key, f"unknown key; {cls._nearest_key(key)}")
        for key, field in cls.model_fields.items():
            if field.is_required() and key not in value:
                raise key_error(key, "it is missing; it must be given")
        return value

    @classmethod
    def _nearest_key(cls, key: str) -> str:
        """Suggest a key for an unknown one, which may be the flag of the command line."""
        for item in () if cls.source is None else option_fields(cls.source):
            flags = (item.option.flag or "").split("/")
            if item.name in cls.model_fields and f"--{key.replace('_', '-')}" in flags:
                return f"did you mean {quoted(item.name)}?"
        return nearest(key, cls.keys())

    @classmethod
    def __get_pydantic_json_schema__(
        cls, core_schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> JsonSchema:
        """JSON Schema of the table: its keys, or a value for the short key."""
        named = handler(core_schema)
        schema = handler.resolve_ref_schema(named)
        schema["additionalProperties"] = False
        schema.setdefault("properties", {}).update(cls.further_keys)
        schema["description"] = cls.__doc__ if cls.source is None else _summary(cls.source)
        others: list[JsonSchema] = [{"type": "boolean"}] if cls.switchable else []
        if cls.short is not None:
            short = schema["properties"][cls.short]
            others.append({key: short[key] for key in short if key not in ("default", "title")})
        if others:
            whole = dict(schema)
            schema.clear()
            schema.update({"title": whole["title"], "anyOf": [*others, whole]})
        return named

    @classmethod
    def keys(cls) -> list[str]:
        """Known keys."""
        return list(cls.model_fields)

    def set_values(self) -> dict[str, Any]:
        """Known keys that the file sets, with their values, in the order of the class."""
        given = self.model_fields_set
        return {key: getattr(self, key) for key in type(self).model_fields if key in given}


class OpenTable(Table):
    """A table that keeps unknown keys, to be validated elsewhere."""

    model_config = ConfigDict(extra="allow")
    takes_more: ClassVar[bool] = True


def table(
    kind: type,
    types_of: Mapping[str, Any] | None = None,
    *,
    name: str | None = None,
    without: tuple[str, ...] = (),
    required: tuple[str, ...] = (),
    short: str | None = None,
    switchable: bool = False,
    takes_more: bool = False,
    more: Mapping[str, Any] | None = None,
) -> type[Table]:
    """Create the model of a table whose keys are the fields of a dataclass."""
    checks = types_of_fields(kind, types_of)
    keys: dict[str, Any] = {}
    for item in option_fields(kind):
        if item.name not in without:
            default = ... if item.name in required or item.required else None
            keys[item.name] = (checks[item.name], Field(default=default))
    for key, kind_of_key in (more or {}).items():
        keys[key] = (kind_of_key, Field(default=... if key in required else None))
    base = OpenTable if takes_more else Table
    model: type[Table] = create_model(name or kind.__name__, __base__=base, **keys)
    model.source, model.short, model.switchable = kind, short, switchable
    return model


@cache
def table_of(kind: Any) -> type[Table]:
    """Return the table of a class whose first field is the one that most files set."""
    return table(kind, short=option_fields(kind)[0].name)


def types_of_fields(kind: type, types_of: Mapping[str, Any] | None = None) -> dict[str, Any]:
    """Types of keys for the fields of a dataclass, for validation and for JSON Schema."""
    return {
        item.name: described(
            (types_of or {}).get(item.name) or _BY_NAME.get(item.name) or _type_of(item),
            item.json_schema(),
        )
        for item in option_fields(kind)
    }


def described(kind: Any, said: JsonSchema | str) -> Any:
    """Type of a key with its description and default, for JSON Schema."""
    if any(getattr(part, "json_schema_extra", None) for part in get_args(kind)[1:]):
        return kind  # already described
    said = {"description": said} if isinstance(said, str) else said

    def add(schema: JsonSchema) -> None:
        schema.pop("default", None)  # a default of None only means that the key is not given
        schema.update({key: said[key] for key in ("description", "default") if key in said})

    return Annotated[kind, Field(json_schema_extra=add)]


class FileSchema(GenerateJsonSchema):
    """JSON Schema generator that lets a value match several forms of a slot."""

    def tagged_union_schema(self, schema: Any) -> JsonSchema:
        """Use `anyOf`, since a file name can look like a color."""
        found = super().tagged_union_schema(schema)
        return {"anyOf": found["oneOf"]} if "oneOf" in found else found


def file_schema(model: type[Table], title: str) -> JsonSchema:
    """JSON Schema of a whole file, draft 2020-12."""
    schema = model.model_json_schema(schema_generator=FileSchema)
    return {"$schema": FileSchema.schema_dialect, **schema, "title": title}


def built_by(model: type[Table], make: Callable[..., Any]) -> Any:
    """Type of a table that becomes the result of `make(**given_keys)`."""
    return converted_by(model, lambda found: make(**found.set_values()))


def switchable_by(model: type[Table], make: Callable[..., Any]) -> Any:
    """As `built_by`, of a switchable table; `false` becomes None."""

    def unless_off(value: Any, check: ValidatorFunctionWrapHandler) -> Any:
        return None if value is False else check(value)

    return Annotated[built_by(model, make), WrapValidator(unless_off)]


def converted_by(kind: Any, convert: Callable[[Any], Any]) -> Any:
    """Type of a value that a function converts after validation."""
    return Annotated[kind, AfterValidator(convert)]


def list_of(kind: Any, convert: Callable[[list[Any]], Any] = tuple) -> Any:
    """Type of a list of values of one type that a function converts."""
    return converted_by(list[kind], convert)


def _type_of(item: OptionField) -> Any:
    """Type of a key, by the types of its field."""
    if item.kinds in _BY_KINDS:
        return _BY_KINDS[item.kinds]
    kind: Any = item.kinds[0] if len(item.kinds) == 1 else None
    if isinstance(kind, type) and is_dataclass(kind):
        return built_by(table_of(kind), kind)
    return Annotated[_check_of(item), WithJsonSchema(item.json_schema())]


def _check_of(item: OptionField) -> Any:
    if len(item.kinds) != 1:
        return Plain
    (only,) = item.kinds
    if only is str and item.option.choices:
        return choice(item.option.choices)
    if get_origin(only) is tuple:
        parts = get_args(only)
        if parts != (int, ...) and all(part in (float, int, ...) for part in parts):
            return numbers(None if ... in parts else len(parts))
        return Plain
    return _BY_KIND.get(only, Plain)


def _summary(kind: type) -> str:
    """First sentence of a class's docstring."""
    return (kind.__doc__ or "").strip().partition("\n")[0]
