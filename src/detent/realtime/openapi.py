"""The control interface over HTTP as an OpenAPI 3.1 document, made of the table of verbs: ``GET /openapi.json``."""

from detent import __version__
from detent.realtime import verbs
from detent.realtime.verbs import Answer, Json, Verb

_ERROR: Json = {
    "type": "object",
    "required": ["error"],
    "properties": {
        "error": {"type": "string", "description": "what is wrong"},
        "remedy": {"type": "string", "description": "what to do"},
    },
}


def document() -> Answer:
    """The whole document."""
    listed: Json = {
        "get": {
            "operationId": "list",
            "summary": "Every verb with its arguments, every kind of fault, and the version.",
            "responses": _responses(),
        }
    }
    return {
        "openapi": "3.1.0",
        "info": {
            "title": "Detent: a cell that is served",
            "version": __version__,
            "description": "Look at a cell that `detent serve --control` serves, meddle with it, break it.",
        },
        "security": [{}, {"token": []}],
        "paths": {"/": listed} | {f"/{verb.name}": _path(verb) for verb in verbs.VERBS.values()},
        "components": {
            "schemas": {"Error": _ERROR},
            "securitySchemes": {"token": {"type": "http", "scheme": "bearer"}},
        },
    }


def _path(verb: Verb) -> Json:
    """Arguments go as one JSON object with POST; one that changes nothing may be asked with GET, and a query."""
    asked: dict[str, Json] = {"summary": verb.help, "responses": _responses()}
    properties: dict[str, Json] = {
        p.name: {**p.kind.schema, "description": f"{p.help}: {p.kind.takes}"} for p in verb.parameters
    }
    schema: dict[str, Json] = {"type": "object", "properties": properties, "additionalProperties": False}
    required: list[Json] = [p.name for p in verb.parameters if p.required]
    if required:
        schema["required"] = required
    body: Json = {"required": bool(required), "content": {"application/json": {"schema": schema}}}
    post: dict[str, Json] = {"operationId": verb.name, **asked, "requestBody": body}
    if verb.changes:
        return {"post": post}
    query: list[Json] = [
        {"name": p.name, "in": "query", "required": p.required, "description": p.help, "schema": p.kind.schema}
        for p in verb.parameters
    ]
    return {"get": {"operationId": f"{verb.name}-asked", **asked, "parameters": query}, "post": post}


def _responses() -> Json:
    def error(what: str) -> Json:
        return {
            "description": what,
            "content": {"application/json": {"schema": {"$ref": "#/components/schemas/Error"}}},
        }

    return {
        "200": {"description": "It is done, or told.", "content": {"application/json": {"schema": {"type": "object"}}}},
        "400": error("It was asked wrongly."),
        "401": error("A token is needed, or is wrong."),
        "403": error("Whoever asks may not."),
        "503": error("The service ends."),
    }
