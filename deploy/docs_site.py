"""Hooks of mkdocs.yml: the pages that are generated, and links out of docs/.

`make docs` builds the site into daemon/site, which the daemon serves under /docs/. Every reference page is made of what
the product itself is made of: docs/openapi.json, deploy/handeyed.example.toml, the commands, the codes, the metrics.
"""

import ast
import html
import json
import re
import sys
from collections.abc import Iterable, Iterator
from hashlib import sha256
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
DOCS = ROOT / "docs"

ELSEWHERE = {"SECURITY.md": "security.md", "CHANGELOG.md": "changelog.md", "CONTRIBUTING.md": "contributing.md"}
"""Pages of the repository's root, and where the site has them."""

LINK = re.compile(r"(!?)\[([^\]\[]*(?:\[[^\]]*\][^\]\[]*)*)\]\(([^)\s]+)\)")
INLINE_SCRIPT = re.compile(r"<script>(.*?)</script>", re.DOTALL)


def on_files(files: Any, config: Any) -> Any:
    """Add the generated pages, and those of the root."""
    from mkdocs.structure.files import File

    for place, text in generated_pages().items():
        files.append(File.generated(config, place, content=text))
    for source, place in ELSEWHERE.items():
        files.append(
            File.generated(config, place, content=relinked((ROOT / source).read_text(encoding="utf-8"), ROOT, ""))
        )
    return files


def on_page_markdown(markdown: str, page: Any, config: Any, files: Any) -> str:
    """The page with links out of docs/ to where the site has them; those to code are left as their words."""
    place = page.file.src_uri
    if page.file.generated_by:
        return markdown
    return relinked(markdown, (DOCS / place).parent, "../" * place.count("/"))


def on_post_build(config: Any) -> None:
    """Move the theme's inline scripts into files: the daemon's pages allow none."""
    site = Path(config["site_dir"])
    for page in site.rglob("*.html"):
        text = page.read_text(encoding="utf-8")
        up = "../" * len(page.relative_to(site).parents[:-1])
        for script in INLINE_SCRIPT.findall(text):
            name = f"assets/javascripts/inline.{sha256(script.encode()).hexdigest()[:12]}.js"
            (site / name).write_text(script, encoding="utf-8")
            text = text.replace(f"<script>{script}</script>", f'<script src="{up}{name}"></script>')
        page.write_text(text, encoding="utf-8")
    for name in ("404.html", "sitemap.xml", "sitemap.xml.gz"):  # the daemon says itself what it does not have
        (site / name).unlink(missing_ok=True)
    for unused in site.rglob("*.map"):
        unused.unlink()


def _script_file(site: Path, up: str, script: str) -> str:
    name = f"assets/javascripts/inline.{sha256(script.encode()).hexdigest()[:12]}.js"
    (site / name).write_text(script, encoding="utf-8")
    return f'<script src="{up}{name}"></script>'


def generated_pages() -> dict[str, str]:
    """Markdown by its place in the site."""
    if str(ROOT) not in sys.path:  # mkdocs takes back what a hook adds while it is loaded
        sys.path.insert(0, str(ROOT))
    openapi = json.loads((ROOT / "docs" / "openapi.json").read_text(encoding="utf-8"))
    return {
        **rest_pages(openapi),
        "reference/settings.md": settings_page((ROOT / "deploy" / "handeyed.example.toml").read_text(encoding="utf-8")),
        "reference/commands.md": commands_page(),
        "reference/codes.md": codes_page(),
        "reference/metrics.md": metrics_page(ROOT / "daemon"),
    }


def relinked(markdown: str, here: Path, up: str) -> str:
    """A page with its links out of the site changed, or left as their words.

    here : the folder of the repository that its links go from; up : the way from the page to the site's root.
    """

    def change(found: re.Match[str]) -> str:
        picture, text, link = found.groups()
        path, _, anchor = link.partition("#")
        if picture or not path or "://" in link or link.startswith("mailto:"):
            return found[0]
        target = (here / path).resolve()
        if (target / "README.md").is_file():
            target /= "README.md"
        place = ELSEWHERE.get(str(target.relative_to(ROOT))) if target.is_relative_to(ROOT) else None
        if target.is_relative_to(DOCS) and not target.is_dir():  # generated ones are not there yet
            place = str(target.relative_to(DOCS))
        return text if place is None else f"[{text}]({up}{place}{'#' + anchor if anchor else ''})"

    return LINK.sub(change, markdown)


def settings_page(example: str) -> str:
    """Every section of the example file under a heading of its own."""
    head, *sections = re.split(r"\n\n(?=(?:#[^\n]*\n)*?#?\[)", example)
    parts = [
        "# Settings",
        "All settings, with their defaults, as the daemon reads them: `deploy/handeyed.example.toml`.",
    ]
    parts.append(
        "`handeyed init` writes the few that a cell needs; `handeyed check FILE` names what is wrong in a file."
    )
    parts.append("\n".join(line.removeprefix("#").strip() for line in head.splitlines() if line.startswith("#")))
    body = "\n\n".join([*([head[head.index("\n\n") + 2 :]] if "\n\n" in head else []), *sections])
    for section in re.split(r"\n\n(?=(?:#[^\n]*\n)*?#?\[)", body):
        name = re.search(r"^#?\[+([^\]]+)\]", section, re.MULTILINE)
        title = name[1] if name else "more"
        parts += [f"## [{title}]" if name else "## More", f"```toml\n{section.strip()}\n```"]
    return "\n\n".join(parts) + "\n"


def commands_page() -> str:
    """Every command with its arguments and options."""
    import typer

    from daemon.cli.main import app

    parts = [
        "# Commands",
        "`handeyed COMMAND --help` prints the same. Every line on standard error says where, what and what to do.",
    ]
    group = typer.main.get_command(app)
    for words, command in _commands(group, ("handeyed",)):
        parts += [f"## {' '.join(words)}", _plain(command.help or "")]
        shown = [one for one in command.params if one.name != "help" and not getattr(one, "hidden", False)]
        rows = [_option_row(one) for one in shown]
        if rows:
            parts.append(table(("option", "default", "meaning"), rows))
    return "\n\n".join(part for part in parts if part) + "\n"


def _commands(group: Any, words: tuple[str, ...]) -> Iterator[tuple[tuple[str, ...], Any]]:
    for name, command in group.commands.items():
        if hasattr(command, "commands"):
            yield from _commands(command, (*words, name))
        else:
            yield (*words, name), command


def _option_row(option: Any) -> tuple[str, str, str]:
    """Names, default and meaning of an option or argument."""
    names = ", ".join([*option.opts, *option.secondary_opts])
    if option.param_type_name == "argument":
        names = option.metavar or str(option.name).upper()
    default = getattr(option.default, "value", option.default)
    shown = str(default) if isinstance(default, str | int | float) and default not in ("", False) else ""
    meaning = _cell(getattr(option, "help", None) or "")
    return f"`{names}`".replace("|", "\\|"), "required" if option.required else shown, meaning


def _plain(text: str) -> str:
    """Help without the brackets' escape, and with angle brackets that a page shows."""
    return html.escape(text.replace("\\[", "["), quote=False)


def codes_page() -> str:
    """Every code of errors, findings and advice, as GET /help has them."""
    import daemon.composition  # noqa: F401 - the errors of all rooms
    from daemon.api.routes.help_codes import _entries

    kinds = {"error": "Errors", "finding": "Findings", "advice": "Advice"}
    about = {
        "error": "`code` of problem+json; the answer's `fix` says what to do.",
        "finding": "`code` of a finding in a result. [causes](../causes.md) has what to do about a contradiction.",
        "advice": "What a run by hand says before the next picture.",
    }
    parts = ["# Codes", "`GET /help/CODE` answers one of them. {Braces} stand for values."]
    entries = sorted(_entries().values(), key=lambda entry: entry.code)
    for kind, title in kinds.items():
        rows = [(f"`{one.code}`", str(one.status or ""), _plain(one.what)) for one in entries if one.kind == kind]
        head = ("code", "HTTP", "meaning") if kind == "error" else ("code", "meaning")
        parts += [
            f"## {title}",
            about[kind],
            table(head, [row if kind == "error" else (row[0], row[2]) for row in rows]),
        ]
    return "\n\n".join(parts) + "\n"


def metrics_page(folder: Path) -> str:
    """Name, type and help of every metric in the source below `folder`."""
    from daemon.api.routes.health import ACCURACY_GAUGES

    rows = {
        (f"`handeyed_calibration_{field.removesuffix('_mm')}_meters`", "gauge", _plain(about))
        for field, about in ACCURACY_GAUGES.items()
    }
    for file in folder.rglob("*.py"):
        tree = ast.parse(file.read_text(encoding="utf-8"))
        for call in ast.walk(tree):
            if isinstance(call, ast.Call) and getattr(call.func, "id", "") == "Metric" and len(call.args) >= 3:
                name, kind, about = (_fixed(argument) for argument in call.args[:3])
                if isinstance(call.args[2], ast.Name) and (said := _assigned(tree, call.args[2].id)):
                    about = said
                if about:
                    rows.add((f"`{name}`", kind, _plain(about)))
                elif name == "handeyed_drift_":
                    rows |= {(f"`{name}{key}`", kind, _plain(said)) for key, said in _described(tree)}
    about = "`GET /metrics`, for Prometheus: `deploy/prometheus` has rules, `deploy/grafana` a dashboard."
    return "\n\n".join(["# Metrics", about, table(("metric", "type", "meaning"), sorted(rows))]) + "\n"


def _fixed(node: ast.expr) -> str:
    """The fixed part of a text; "" for a name."""
    if isinstance(node, ast.JoinedStr):
        return "".join(_fixed(part) for part in node.values)
    return str(node.value) if isinstance(node, ast.Constant) else ""


def _assigned(tree: ast.Module, name: str) -> str:
    """The text that a name is set to; "" where it is none."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Assign) and getattr(node.targets[0], "id", "") == name:
            return _fixed(node.value)
    return ""


def _described(tree: ast.Module) -> Iterator[tuple[str, str]]:
    """The first two of each tuple of three that begins with two texts."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Tuple) and len(node.elts) == 3:
            name, about = _fixed(node.elts[0]), _fixed(node.elts[1])
            if name and about:
                yield name, about


def rest_pages(openapi: dict[str, Any]) -> dict[str, str]:
    """One page of operations for each tag, one of all the documents, and their index."""
    about = {tag["name"]: tag["description"] for tag in openapi["tags"]}
    tags: dict[str, list[tuple[str, str, dict[str, Any]]]] = {}
    for path, methods in openapi["paths"].items():
        for method, operation in methods.items():
            if method in ("get", "post", "put", "delete", "patch"):
                tags.setdefault(operation["tags"][0], []).append((method.upper(), path, operation))
    index = [
        "# Every operation",
        "Made from openapi.json, which `GET /openapi.json` answers. By example: [REST by example](../api.md).",
    ]
    pages = {}
    for tag, operations in tags.items():
        said = about.get(tag, "")
        rows = [
            (f"[`{method} {path}`]({tag}.md#{anchor_of(method, path)})", first_sentence(one))
            for method, path, one in operations
        ]
        index += [f"## {tag}", said, table(("operation", "what it does"), rows)]
        parts = [f"# {tag}", said, *(_operation(openapi, *one) for one in operations)]
        pages[f"api/{tag}.md"] = "\n\n".join(part for part in parts if part) + "\n"
    schemas = openapi["components"]["schemas"]
    documents = ["# Documents of the REST interface", *(_schema(name, schemas[name]) for name in sorted(schemas))]
    return {
        **pages,
        "api/operations.md": "\n\n".join(filter(None, index)) + "\n",
        "api/documents.md": "\n\n".join(documents) + "\n",
    }


def anchor_of(method: str, path: str) -> str:
    """The id of an operation's heading."""
    return re.sub(r"[^a-z0-9]+", "-", f"{method} {path}".lower()).strip("-")


def first_sentence(operation: dict[str, Any]) -> str:
    """What an operation does, in a sentence."""
    text = _plain(" ".join((operation.get("description") or operation.get("summary") or "").split()))
    return re.split(r"(?<=\.)\s", text, maxsplit=1)[0]


def _operation(openapi: dict[str, Any], method: str, path: str, operation: dict[str, Any]) -> str:
    """One operation: what it does, who may, what it takes, what it answers, and a line of curl."""
    parts = [
        f"## {method} {path} {{ #{anchor_of(method, path)} }}",
        _plain(operation.get("description") or operation.get("summary", "")),
    ]
    if role := operation.get("x-role"):
        parts.append(f"Role: {role}.")
    parameters = [_resolved(openapi, one) for one in operation.get("parameters", ())]
    if parameters:
        rows = [(f"`{one['name']}`", one["in"], type_of(one.get("schema", {})), "yes" if one.get("required") else "",
                 _cell(one.get("description", ""))) for one in parameters]  # fmt: skip
        parts.append(table(("parameter", "in", "type", "required", "meaning"), rows))
    body = operation.get("requestBody")
    if body:
        kinds = [f"`{kind}`: {type_of(content.get('schema', {}))}" for kind, content in body["content"].items()]
        parts.append(f"Body: {'; '.join(kinds)}.")
    rows = []
    for status, answer in operation["responses"].items():
        known = _resolved(openapi, answer)
        kinds = [
            type_of(content.get("schema", {}))
            for kind, content in known.get("content", {}).items()
            if kind.endswith("json")
        ]
        rows.append((status, ", ".join(kinds), _cell(known.get("description", ""))))
    parts.append(table(("status", "document", "meaning"), rows))
    sends = "" if method == "GET" else f" -X {method}"
    given = " -H 'Content-Type: application/json' -d '{}'" if body and "application/json" in body["content"] else ""
    parts.append(f"```\ncurl{sends}{given} http://127.0.0.1:8372{path}\n```")
    return "\n\n".join(part for part in parts if part)


def _resolved(openapi: dict[str, Any], given: dict[str, Any]) -> dict[str, Any]:
    found: Any = given
    if "$ref" in given:
        found = openapi
        for part in given["$ref"].removeprefix("#/").split("/"):
            found = found[part]
    return dict(found)


def type_of(schema: dict[str, Any]) -> str:
    """The type of a value in words; documents as links."""
    if "$ref" in schema:
        name = schema["$ref"].rsplit("/", 1)[1]
        return f"[{name}](documents.md#{name.lower()})"
    for joined in ("anyOf", "oneOf", "allOf"):
        if joined in schema:
            return " or ".join(dict.fromkeys(type_of(one) for one in schema[joined]))
    if "const" in schema or "enum" in schema:
        return ", ".join(f"`{one}`" for one in schema.get("enum", [schema.get("const")]))
    kind = str(schema.get("type", "any"))
    if kind == "array":
        inner = [type_of(one) for one in schema.get("prefixItems", [schema.get("items") or {}])]
        return "list of " + ", ".join(dict.fromkeys(inner))
    limits = [f"{word} {schema[name]:g}" for name, word in (("minimum", "at least"), ("exclusiveMinimum", "above"),
              ("maximum", "at most"), ("exclusiveMaximum", "below")) if name in schema]  # fmt: skip
    return " ".join([kind, *limits])


def _schema(name: str, schema: dict[str, Any]) -> str:
    """One document: its fields, or its type."""
    required = set(schema.get("required", ()))
    rows = []
    for field, one in schema.get("properties", {}).items():
        kind, always = type_of(one).replace("documents.md#", "#"), "yes" if field in required else ""
        rows.append((f"`{field}`", kind, always, _cell(one.get("description", ""))))
    head = ("field", "type", "always", "meaning")
    fields = table(head, rows) if rows else type_of(schema).replace("documents.md#", "#")
    parts = [f"## {name} {{ #{name.lower()} }}", _plain(schema.get("description", "")), fields]
    return "\n\n".join(part for part in parts if part)


def _cell(text: str) -> str:
    """Text in a cell of a table."""
    return _plain(" ".join(text.split())).replace("|", "\\|")


def table(head: tuple[str, ...], rows: Iterable[tuple[str, ...]]) -> str:
    """A table of Markdown."""
    lines = [head, tuple("---" for _ in head), *rows]
    return "\n".join("| " + " | ".join(cell.replace("\n", " ") for cell in line) + " |" for line in lines)
