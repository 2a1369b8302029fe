"""Files of `export`, then the numbers of the geometry."""

from __future__ import annotations

from pathlib import Path

from rich.console import Console

from spirillum.cli.tables.parts import Answer, add_quantities, grid


def table(answer: Answer, console: Console) -> None:
    """Files, then the numbers of the geometry."""
    first, *others = (Path(item["file"]) for item in answer["files"])
    meshes = [path for path in others if path.parent != first.parent]
    lines = [f"{item['file']}: {item['holds']}" for item in answer["files"] if Path(item["file"]) not in meshes]
    if meshes:
        lines.insert(1, f"{meshes[0].parent}: {len(meshes)} mesh files, in mm")
    for line in lines:
        console.print(line, highlight=False, markup=False, soft_wrap=True)
    if "solid" in answer:
        solid = answer["solid"]
        state = "watertight" if solid["watertight"] else "not watertight"
        bodies = "one body" if solid["bodies"] == 1 else f"{solid['bodies']} bodies"
        console.print(f"{bodies}, {state}, {solid['triangles']} triangles", highlight=False)
        size = " x ".join(f"{1e3 * value:.4g}" for value in solid["size"]["value"])
        console.print(f"{size} mm, {1e6 * solid['volume']['value']:.4g} ml", highlight=False)
        return
    if "parameters" in answer:
        rows = grid(
            f"{answer['robot']}: model {answer['model']}, friction {answer['friction']}", "parameter", "value", "unit"
        )
        for name, item in answer["parameters"].items():
            rows.add_row(name, f"{item['value']:.6g}", item["unit"])
        console.print(rows)
        return
    rows = grid(f"{answer['robot']}: links", "quantity", "value", "unit", "SI")
    for name, link in answer["links"].items():
        add_quantities(rows, {f"{name} {key}": link[key] for key in ("mass", "displaced_volume")})
    console.print(rows)
