"""Install, start and control a real Blender with a window, by mouse and keyboard. Uses only the standard library.

Each Blender is in its own Debian folder (a chroot, made by `install.sh`) and renders in software to its own virtual
screen. `inside.py` runs in Blender, and tells where buttons are and what the data is. Everything else is done by events
of the window system, so that the tests see the same as a user.
"""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

HERE = Path(__file__).resolve().parent
SUITES = {"5.2": "sid", "4.3": "trixie"}
"""Version of Blender to the Debian suite that has it."""
WIDTH, HEIGHT = 1280, 1400
"""Size of the screen, high enough for the whole side panel."""
MOUNTS = (
    ("proc", ["-t", "proc", "proc"]),
    ("sys", ["--bind", "/sys"]),
    ("dev", ["--bind", "/dev"]),
    ("dev/pts", ["--bind", "/dev/pts"]),
    ("dev/shm", ["-t", "tmpfs", "tmpfs"]),
)
HEADER_HEIGHT = 26
"""Height of the header of a sub-panel, in pixels."""
ROW_HEIGHT = 21
"""Height of a row in a list, in pixels."""
COLOR_ACROSS, MENU_ACROSS = 0.11, 0.2
"""Horizontal positions of the colors in the list of segments and of the menu below it, relative to the width."""
FIRST_FIELD, FIELD_HEIGHT = 45, 23
"""Distance of the first field of the panel of the last operator from its top, and of each next field, in pixels."""
TIMEOUT = 600
"""Seconds after which Blender counts as hanging."""


def build_zip(folder: Path) -> Path:
    """Build the current extension for the Pythons of Debian's Blenders; path of the ZIP."""
    script = HERE.parents[1] / "scripts" / "build_zip.py"
    command = [sys.executable, str(script), "--platform", "linux-x64", "--python", "3.13", "3.14"]
    subprocess.run([*command, "--output", str(folder)], check=True, stdout=subprocess.DEVNULL)
    return next(folder.glob("*.zip"))


class WindowError(Exception):
    """Blender did not do what it was asked to; the message ends with the last lines of its log."""


class RealBlender:
    """A Blender with a window. At the end of a `with` block, its processes are ended and its folders unmounted."""

    def __init__(self, version: str, folder: Path, display: int = 91) -> None:
        self.version = version
        self.root = folder.resolve() / f"blender{version.replace('.', '')}"
        self.shared = self.root / "window"
        """Folder that Blender sees as /window."""
        self.user = "/window/user"
        """Folder of the user's settings and extensions, as Blender sees it: that of a new user."""
        self.display = display
        self.clicks = 0
        """Number of clicks and drags since the start."""
        self._running: list[subprocess.Popen[bytes]] = []
        self._mounted: list[Path] = []
        self._asked = 0
        self._places: dict[str, tuple[int, int]] = {}
        """Where buttons of the side panel were last."""

    def __enter__(self) -> RealBlender:
        subprocess.run([HERE / "install.sh", SUITES[self.version], self.root], check=True)
        for name, options in MOUNTS:
            target = self.root / name
            if not os.path.ismount(target):
                subprocess.run(["mount", *options, target], check=True)
                self._mounted.append(target)
        shutil.rmtree(self.shared, ignore_errors=True)
        self.shared.mkdir()
        return self

    def __exit__(self, *error: object) -> None:
        self.stop()
        for target in reversed(self._mounted):
            subprocess.run(["umount", target], check=True)
        self._mounted.clear()

    # Programs.

    def command(self, *arguments: str | Path) -> str:
        """Run Blender without a window, with the same user settings; return its output."""
        inside = self._inside("blender", *arguments)
        done = subprocess.run(inside, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False)
        if done.returncode:
            raise WindowError(f"blender {' '.join(map(str, arguments))}\n{done.stdout}")
        return done.stdout

    def install_extension(self, path: Path) -> None:
        """Install and enable a ZIP, as *Install from Disk* does."""
        self.command(
            "--command", "extension", "install-file", "--repo", "user_default", "--enable", self.bring(path)
        )  # fmt: skip

    def make_scene(self, content: str, name: str) -> str:
        """Make a scene with `make_scene.py`; return its path inside."""
        path = f"/window/{name}"
        self.command("--background", "--python-exit-code", "1", "--python", self.bring(HERE / "make_scene.py"),
                     "--", content, path)  # fmt: skip
        return path

    def bring(self, path: Path) -> str:
        """Copy a file to the shared folder; return its path inside."""
        shutil.copyfile(path, self.shared / path.name)
        return f"/window/{path.name}"

    def start(self, *arguments: str) -> None:
        """Open the window, with a file if its name is given, and wait until it is drawn."""
        self.bring(HERE / "inside.py")
        self._places.clear()
        for name in ("answer", "question"):
            (self.shared / name).unlink(missing_ok=True)
        screen = f"{WIDTH}x{HEIGHT}x24"
        self._start("Xvfb", f":{self.display}", "-screen", "0", screen, "+extension", "GLX", "-nolisten", "tcp")
        socket = self.root / f"tmp/.X11-unix/X{self.display}"
        deadline = time.monotonic() + 30
        while not socket.exists():
            if time.monotonic() > deadline:
                raise WindowError(f"Xvfb does not start\n{self.log('Xvfb')}")
            time.sleep(0.1)
        geometry = ("0", "0", str(WIDTH), str(HEIGHT))
        self._start("blender", "--window-geometry", *geometry, *arguments, "--python", "/window/inside.py")
        self.ask("ready")

    def stop(self) -> None:
        """Close the window without saving."""
        for process in reversed(self._running):
            if process.poll() is None:
                os.killpg(process.pid, signal.SIGTERM)  # a group of its own, see _start
            try:
                process.wait(10)
            except subprocess.TimeoutExpired:
                os.killpg(process.pid, signal.SIGKILL)
                process.wait(10)
        self._running.clear()
        (self.root / f"tmp/.X{self.display}-lock").unlink(missing_ok=True)
        (self.root / f"tmp/.X11-unix/X{self.display}").unlink(missing_ok=True)

    def log(self, program: str = "blender") -> str:
        """Output of a program since its start."""
        path = self.shared / f"{program}.log"
        return path.read_text(errors="replace") if path.exists() else ""

    # Mouse, keyboard, screen.

    def move(self, x: int, y: int) -> None:
        """Move the mouse to a point in two steps: Blender ignores a mouse that only jumps."""
        self._xdotool("mousemove", x - 3, y - 2, "sleep", "0.05", "mousemove", x, y)
        self.settle()

    def click(self, x: int, y: int, button: int = 1, repeat: int = 1) -> None:
        """Click at a point; buttons 4 and 5 are the wheel."""
        self.move(x, y)
        self._xdotool("click", "--repeat", repeat, "--delay", "60", button)
        self.clicks += button < 4
        self.settle()

    def drag(self, x: int, y: int, to_x: int, to_y: int, button: int = 1) -> None:
        """Drag from one point to another, slowly: a busy Blender takes a quick drag for a click."""
        self.move(x, y)
        middle = ((x + to_x) // 2, (y + to_y) // 2)
        for step in (("mousedown", button), ("mousemove", *middle), ("mousemove", to_x, to_y), ("mouseup", button)):
            self._xdotool(*step)
            self.settle()
        self.clicks += 1

    def key(self, *names: str) -> None:
        """Press keys one after the other, such as `ctrl+z`; they act on the region under the mouse."""
        for name in names:
            self._xdotool("key", name)
            self.settle()

    def type(self, text: str) -> None:
        """Type text."""
        self._xdotool("type", "--delay", "40", text)
        self.settle()

    def screenshot(self, path: Path, box: tuple[int, int, int, int] | None = None) -> None:
        """Save the screen, or a box of it (x, y, width, height), to a file."""
        path.parent.mkdir(parents=True, exist_ok=True)
        cut = [] if box is None else ["--autoselect", ",".join(map(str, box))]
        # Blender's own screenshots are black when it renders in software.
        self._check(self._inside("scrot", "--overwrite", *cut, "/window/screen.png"))
        shutil.copyfile(self.shared / "screen.png", path)

    # Questions to `inside.py`.

    def ask(self, question: str, *arguments: Any, timeout: float = TIMEOUT) -> Any:
        """Result of a function of `inside.py`; WindowError if it failed or Blender has ended."""
        self._asked += 1
        answer = self.shared / "answer"
        answer.unlink(missing_ok=True)
        draft = self.shared / "draft"
        draft.write_text(json.dumps([self._asked, question, arguments]))
        draft.rename(self.shared / "question")
        deadline = time.monotonic() + timeout
        while not answer.exists():
            gone = any(process.poll() is not None for process in self._running)
            if gone or time.monotonic() > deadline:
                raise WindowError(
                    f"no answer to {question}: Blender is {'gone' if gone else 'busy'}\n{self.log()[-3000:]}"
                )
            time.sleep(0.02)
        number, failed, value = json.loads(answer.read_text())
        if failed or number != self._asked:
            raise WindowError(f"{question}{tuple(arguments)}: {value}\n{self.log()[-3000:]}")
        return value

    def settle(self) -> None:
        """Wait until all events are handled and the window is drawn."""
        self.ask("settle")

    def wait_for(self, question: str, *arguments: Any, timeout: float = TIMEOUT) -> Any:
        """Ask until the answer is true; return it."""
        deadline = time.monotonic() + timeout
        while not (value := self.ask(question, *arguments)):
            if time.monotonic() > deadline:
                raise WindowError(f"{question}{tuple(arguments)} stays {value!r}\n{self.log()[-3000:]}")
            time.sleep(0.1)
        return value

    # Steps of a user.

    def select(self, name: str) -> None:
        """Click on an object in the viewport."""
        self.click(*self.ask("place_of", name))

    def open_sidebar(self, tab: str = "WKS") -> None:
        """Press N over the viewport, and click on a tab."""
        if not self.ask("tab"):
            self.over_viewport()
            self.key("n")
            self.wait_for("tab", timeout=10)
        x, y, width, height = self.ask("region", "UI")
        clicks = self.clicks
        for down in range(20, height, 25):
            if self.ask("tab") == tab:
                self.clicks = clicks + (down > 20)  # a user sees the tab and clicks once
                return
            self.click(x + width - 12, y + down)
        raise WindowError(f"the side panel has no tab {tab}")

    def find(self, name: str) -> tuple[int, int]:
        """Position of the button of an operator or property in the side panel; its sub-panel is opened if necessary."""
        # Where it was is looked first: a search takes half a minute, and the panel hardly ever moves.
        if name in self._places and self.ask("button_at", *self._places[name]) == name:
            return self._places[name]
        buttons = self._look_for(name)
        if name in buttons:
            return self._places[name]
        # Sub-panels follow the last button. A click on a header opens the panel, another click closes it.
        x, last = max(buttons.values(), key=lambda place: place[1])
        clicks = self.clicks
        for header in range(last + HEADER_HEIGHT, last + 8 * HEADER_HEIGHT, HEADER_HEIGHT):
            self.click(x, header)
            opened = self._look_for(name, header)
            if name in opened:
                self.clicks = clicks + 1  # a user reads the title and clicks once
                return self._places[name]
            if opened:
                self.click(x, header)
        raise WindowError(f"the side panel has no {name}: {', '.join(sorted(buttons))}")

    def _look_for(self, name: str, below: int = 0) -> dict[str, list[int]]:
        """Positions of the buttons of the side panel below a height, up to that of a name if it is there."""
        buttons: dict[str, list[int]] = self.ask("buttons", name, below)
        self._places |= {each: (x, y) for each, (x, y) in buttons.items()}
        return buttons

    def press(self, name: str) -> None:
        """Click on a button of the side panel."""
        self.click(*self.find(name))

    def enter(self, name: str, text: str) -> None:
        """Set a field of the side panel: double click, type, Enter."""
        self.click(*self.find(name), repeat=2)
        self.key("ctrl+a")
        self.type(text)
        self.key("Return")

    def adjust(self, field: int, text: str) -> None:
        """Set a field of the panel that adjusts the last operator, in the viewport; it is opened if necessary.

        Fields are counted from 0, since Blender does not tell which fields there are.
        """
        x, y, width, height = self.ask("region", "HUD")
        if height < 2 * HEADER_HEIGHT:
            self.click(x + width // 2, y + height // 2)
            x, y, width, height = self.ask("region", "HUD")
        self.click(x + int(0.7 * width), y + FIRST_FIELD + FIELD_HEIGHT * field, repeat=2)
        self.key("ctrl+a")
        self.type(text)
        self.key("Return")

    def row(self, index: int) -> tuple[int, int]:
        """Position of the name of a segment in the list."""
        x, y = self.find("active_segment")
        return x, y + ROW_HEIGHT * index

    def swatch(self, index: int) -> tuple[int, int]:
        """Position of the color of a segment in the list."""
        left, _, width, _ = self.ask("region", "UI")
        return left + int(COLOR_ACROSS * width), self.row(index)[1]

    def merge(self, index: int, into: int) -> None:
        """Merge a segment of the list into another one, by the menu on the left of Split."""
        self.click(*self.row(index))
        left, _, width, _ = self.ask("region", "UI")
        self.click(left + int(MENU_ACROSS * width), self.find("wks_segment.split_segment")[1])
        # The menu leaves the segment itself out, and its first item is chosen by one press.
        self.key(*["Down"] * (into + (into < index)), "Return")

    def choose(self, name: str, *keys: str) -> None:
        """Open a menu of the side panel and press the underlined letter of an item, or Down up to it and Return."""
        self.press(name)
        self.key(*keys)
        self.clicks += 1  # a user clicks on the item

    def over_viewport(self) -> None:
        """Move the mouse over the viewport, so that keys act on it."""
        x, y, width, height = self.ask("region", "WINDOW")
        self.move(x + width // 2, y + height - 40)  # not over the panel of the last operator

    def _start(self, *command: str) -> None:
        with open(self.shared / f"{command[0]}.log", "wb") as log:
            self._running.append(
                subprocess.Popen(self._inside(*command), stdout=log, stderr=subprocess.STDOUT, start_new_session=True)
            )

    def _xdotool(self, *arguments: str | int) -> None:
        self._check(self._inside("xdotool", *map(str, arguments)))

    def _check(self, command: list[str]) -> None:
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode:
            raise WindowError(f"{' '.join(command)}\n{done.stderr}\n{self.log()[-3000:]}")

    def _inside(self, *command: str | Path) -> list[str]:
        environment = {
            "DISPLAY": f":{self.display}",
            "LIBGL_ALWAYS_SOFTWARE": "1",
            "HOME": "/window",
            "XDG_RUNTIME_DIR": "/tmp",
            "BLENDER_USER_RESOURCES": self.user,
            "PYTHONUNBUFFERED": "1",
            "PATH": "/usr/bin:/bin",
        }
        # env takes the variables as arguments.
        variables = [f"{name}={value}" for name, value in environment.items()]
        return ["chroot", str(self.root), "env", "-i", *variables, *map(str, command)]
