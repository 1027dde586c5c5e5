"""Static parts of the scene: floor, table, light, background, initial camera."""

import math

import viser

from app.live.reach.commands import is_reaching
from app.sim.cells.cell import Cell
from app.sim.cells.colours import OBSTACLE, ROBOT_PLATE, TABLE_EDGE, TABLE_FRAME, TABLE_TOP
from web.viewer.poses import upright
from web.viewer.solid_meshes import block, material, painted, rod, slab

TOP = material(TABLE_TOP, roughness=0.55)
EDGE = material(TABLE_EDGE, roughness=0.6)
FRAME = material(TABLE_FRAME, metallic=0.35, roughness=0.45)
FOOT = material((52, 55, 61), roughness=0.6)
PLATE = material(ROBOT_PLATE, metallic=0.5, roughness=0.4)

GRID, GRID_BOLD = (160, 170, 182), (134, 145, 158)


def build(server: viser.ViserServer, cell: Cell) -> None:
    """Add floor, table, light, background and camera to an empty scene."""
    scene = server.scene
    scene.set_up_direction("+z")
    scene.world_axes.visible = False
    scene.add_glb("/table", table_body(cell))
    scene.add_glb("/table/trim", table_trim(cell), cast_shadow=False)
    _obstacles(server, cell)
    _floor(server, cell)
    _light(server)
    _camera(server, cell)


def table_body(cell: Cell) -> bytes:
    """Return the table's top, frame, legs and feet as binary glTF."""
    t = cell.table
    width, depth = t.x_max - t.x_min, t.y_max - t.y_min
    cx, cy = 0.5 * (t.x_min + t.x_max), 0.5 * (t.y_min + t.y_max)
    pieces = [
        (slab((width, depth, t.thickness), (cx, cy, -0.5 * t.thickness), 0.03, 0.003), TOP)
    ]
    inset, leg = 0.11, 0.07
    xs = (t.x_min + inset, t.x_max - inset)
    ys = (t.y_min + inset, t.y_max - inset)
    under, floor = -t.thickness, cell.floor_z
    for x in xs:
        for y in ys:
            height = under - floor - 0.03
            pieces.append(
                (block((leg, leg, height), (x, y, floor + 0.03 + 0.5 * height), 0.006), FRAME)
            )
            pieces.append((rod((x, y, floor), 0.03, 0.03), FOOT))
        beam = (x, cy, under - 0.04)
        pieces.append((block((0.05, ys[1] - ys[0], 0.08), beam, 0.005), FRAME))
    for y in ys:
        pieces.append((block((xs[1] - xs[0], 0.05, 0.08), (cx, y, under - 0.04), 0.005), FRAME))
    return painted(pieces)


def table_trim(cell: Cell) -> bytes:
    """Return edge band and robot plate, too thin to cast a shadow, as binary glTF."""
    t = cell.table
    width, depth = t.x_max - t.x_min, t.y_max - t.y_min
    center = (0.5 * (t.x_min + t.x_max), 0.5 * (t.y_min + t.y_max), -0.5 * t.thickness - 0.003)
    band = slab((width + 0.004, depth + 0.004, t.thickness - 0.012), center, 0.032, 0.001)
    return painted(
        [(band, EDGE), (slab((0.3, 0.3, 0.008), (0.0, 0.0, 0.004), 0.02, 0.0015), PLATE)]
    )


def _obstacles(server: viser.ViserServer, cell: Cell) -> None:
    for box in cell.obstacles:
        server.scene.add_box(
            f"/obstacles/{box.id}",
            color=OBSTACLE,
            dimensions=(2.0 * box.half_size[0], 2.0 * box.half_size[1], 2.0 * box.half_size[2]),
            wxyz=upright(box.yaw),
            position=box.center,
        )


def _floor(server: viser.ViserServer, cell: Cell) -> None:
    server.scene.add_grid(
        "/floor",
        plane="xy",
        position=(0.0, 0.4, cell.floor_z),
        infinite_grid=True,
        cell_size=0.25,
        section_size=1.0,
        cell_color=GRID,
        section_color=GRID_BOLD,
        cell_thickness=0.6,
        section_thickness=1.0,
        fade_distance=9.0,
        fade_strength=1.4,
        fade_from="origin",
        shadow_opacity=0.22,
        plane_opacity=0.0,  # What is behind follows the visitor's light or dark.
    )


def _light(server: viser.ViserServer) -> None:
    """Add lights but no environment map: the viewer hides the scene until one is decoded."""
    scene = server.scene
    scene.configure_environment_map(None)
    scene.configure_default_lights(enabled=True, cast_shadow=True)
    scene.add_light_hemisphere(
        "/light/sky", sky_color=(255, 255, 255), ground_color=(168, 176, 188), intensity=1.7
    )
    scene.add_light_directional(
        "/light/side", color=(255, 250, 242), intensity=0.9, position=(3.0, -3.0, 2.0)
    )


def _camera(server: viser.ViserServer, cell: Cell) -> None:
    """Set the initial camera: nearer for blocks, farther for pedestrians."""
    camera = server.initial_camera
    if cell.stations_of("clutter"):
        camera.position, camera.look_at = (2.14, -0.88, 1.58), (-0.02, 0.58, 0.1)
    elif is_reaching(cell):
        camera.position, camera.look_at = (2.9, -2.0, 2.2), (-0.25, 0.75, 0.0)
    else:
        camera.position, camera.look_at = (2.2, -0.9, 1.36), (0.0, 0.68, 0.17)
    camera.up = (0.0, 0.0, 1.0)
    camera.fov = math.radians(40.0)
