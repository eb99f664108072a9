"""Installs, starts and drives a real Blender in its own window, with mouse and keyboard. Standard library only.

Each Blender lives in a Debian folder of its own (a chroot that `install.sh` makes) and draws, in software, on a screen
of its own. `inside.py` runs in it: it says where buttons are and what the data is. Everything else is done
by events that the window system sends, so that what is tested is what a person gets.
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
"""Which Debian has which Blender."""
WIDTH, HEIGHT = 1280, 1400
"""Size of the screen: high enough for the whole side panel."""
MOUNTS = (
    ("proc", ["-t", "proc", "proc"]),
    ("sys", ["--bind", "/sys"]),
    ("dev", ["--bind", "/dev"]),
    ("dev/pts", ["--bind", "/dev/pts"]),
    ("dev/shm", ["-t", "tmpfs", "tmpfs"]),
)
HEADER = 26
"""Height of the header of a sub-panel."""
ROW = 21
"""Height of a row in a list."""
FIRST_FIELD, FIELD = 45, 23
"""Where the first field of the last operator is, below its top, and how far the next."""
PATIENCE = 600
"""Seconds after which Blender is taken to hang."""


def build_zip(folder: Path) -> Path:
    """The extension as it is now, for the Pythons that Debian's Blenders have."""
    script = HERE.parents[1] / "scripts" / "build_zip.py"
    command = [sys.executable, str(script), "--platform", "linux-x64", "--python", "3.13", "3.14"]
    subprocess.run([*command, "--output", str(folder)], check=True, stdout=subprocess.DEVNULL)
    return next(folder.glob("*.zip"))


class WindowError(Exception):
    """Blender did not do what it was asked to, with the end of its log."""


class RealBlender:
    """A Blender with a window. Use it in a `with` block: what was started and mounted is taken down at its end."""

    def __init__(self, version: str, folder: Path, display: int = 91) -> None:
        self.version = version
        self.root = folder.resolve() / f"blender{version.replace('.', '')}"
        self.shared = self.root / "window"
        """The folder that both sides see; /window for those inside."""
        self.display = display
        self.clicks = 0
        """Clicks and drags since the start: what a way costs."""
        self._running: list[subprocess.Popen[bytes]] = []
        self._mounted: list[Path] = []
        self._asked = 0

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

    # What is started.

    def command(self, *arguments: str | Path) -> str:
        """Run Blender without a window to its end; what it printed. The user's settings are those of the window."""
        inside = self._inside("blender", *arguments)
        done = subprocess.run(inside, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False)
        if done.returncode:
            raise WindowError(f"blender {' '.join(map(str, arguments))}\n{done.stdout}")
        return done.stdout

    def install_extension(self, path: Path) -> None:
        """Install and enable a zip, as *Install from Disk* does."""
        self.command(
            "--command", "extension", "install-file", "--repo", "user_default", "--enable", self.bring(path)
        )  # fmt: skip

    def make_scene(self, what: str, name: str) -> str:
        """Make a scene with `make_scene.py`; where it is. Other files that it needs are brought before."""
        path = f"/window/{name}"
        self.command("--background", "--python-exit-code", "1", "--python", self.bring(HERE / "make_scene.py"),
                     "--", what, path)  # fmt: skip
        return path

    def bring(self, path: Path) -> str:
        """Copy a file to where Blender can see it; its name there."""
        shutil.copyfile(path, self.shared / path.name)
        return f"/window/{path.name}"

    def start(self, *arguments: str, beautiful: bool = False) -> None:
        """Open the window, with a file if its name is given, and wait until it draws; beautiful is slow."""
        self.bring(HERE / "inside.py")
        if beautiful:
            (self.shared / "beautiful").touch()
        for name in ("answer", "question"):
            (self.shared / name).unlink(missing_ok=True)
        screen = f"{WIDTH}x{HEIGHT}x24"
        self._run_along("Xvfb", f":{self.display}", "-screen", "0", screen, "+extension", "GLX", "-nolisten", "tcp")
        socket = self.root / f"tmp/.X11-unix/X{self.display}"
        deadline = time.monotonic() + 30
        while not socket.exists():
            if time.monotonic() > deadline:
                raise WindowError(f"Xvfb does not start\n{self.log('Xvfb')}")
            time.sleep(0.1)
        geometry = ("0", "0", str(WIDTH), str(HEIGHT))
        self._run_along("blender", "--window-geometry", *geometry, *arguments, "--python", "/window/inside.py")
        self.ask("ready")

    def stop(self) -> None:
        """Close the window without saving."""
        for process in reversed(self._running):
            if process.poll() is None:
                os.killpg(process.pid, signal.SIGTERM)  # a group of its own, see _run_along
            try:
                process.wait(10)
            except subprocess.TimeoutExpired:
                os.killpg(process.pid, signal.SIGKILL)
                process.wait(10)
        self._running.clear()
        (self.root / f"tmp/.X{self.display}-lock").unlink(missing_ok=True)
        (self.root / f"tmp/.X11-unix/X{self.display}").unlink(missing_ok=True)

    def log(self, program: str = "blender") -> str:
        """What a program has printed since it was started."""
        path = self.shared / f"{program}.log"
        return path.read_text(errors="replace") if path.exists() else ""

    # Mouse, keyboard, screen.

    def move(self, x: int, y: int) -> None:
        """Move the mouse there, the way a hand does: Blender wants to see it come."""
        self._xdotool("mousemove", x - 3, y - 2, "sleep", "0.05", "mousemove", x, y)
        self.settle()

    def click(self, x: int, y: int, button: int = 1, repeat: int = 1) -> None:
        """Click there; button 4 and 5 are the wheel."""
        self.move(x, y)
        self._xdotool("click", "--repeat", repeat, "--delay", "60", button)
        self.clicks += button < 4
        self.settle()

    def drag(self, x: int, y: int, to_x: int, to_y: int, button: int = 1) -> None:
        """Press there and let go elsewhere; slowly, since a busy Blender takes a quick one for a click."""
        self.move(x, y)
        middle = ((x + to_x) // 2, (y + to_y) // 2)
        for step in (("mousedown", button), ("mousemove", *middle), ("mousemove", to_x, to_y), ("mouseup", button)):
            self._xdotool(*step)
            self.settle()
        self.clicks += 1

    def key(self, *names: str) -> None:
        """Press keys one after the other, as `ctrl+z`; where the mouse is decides what they do."""
        for name in names:
            self._xdotool("key", name)
            self.settle()

    def type(self, text: str) -> None:
        """Type a text."""
        self._xdotool("type", "--delay", "40", text)
        self.settle()

    def screenshot(self, path: Path, box: tuple[int, int, int, int] | None = None) -> None:
        """Save what a person would see, or a box of it (x, y, width, height)."""
        path.parent.mkdir(parents=True, exist_ok=True)
        cut = [] if box is None else ["--autoselect", ",".join(map(str, box))]
        # Blender's own screenshot is black where it draws in software.
        self._check(self._inside("scrot", "--overwrite", *cut, "/window/screen.png"))
        shutil.copyfile(self.shared / "screen.png", path)

    # What is inside.

    def ask(self, question: str, *arguments: Any, patience: float = PATIENCE) -> Any:
        """The answer of a function of `inside.py`; WindowError if it failed or Blender is gone."""
        self._asked += 1
        answer = self.shared / "answer"
        answer.unlink(missing_ok=True)
        draft = self.shared / "draft"
        draft.write_text(json.dumps([self._asked, question, arguments]))
        draft.rename(self.shared / "question")
        deadline = time.monotonic() + patience
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
        """Wait until events are dealt with and the window is drawn."""
        self.ask("settle")

    def wait_for(self, question: str, *arguments: Any, patience: float = PATIENCE) -> Any:
        """Ask until the answer is true; it."""
        deadline = time.monotonic() + patience
        while not (value := self.ask(question, *arguments)):
            if time.monotonic() > deadline:
                raise WindowError(f"{question}{tuple(arguments)} stays {value!r}\n{self.log()[-3000:]}")
            time.sleep(0.1)
        return value

    # What a person does without thinking.

    def select(self, name: str) -> None:
        """Click on an object in the viewport."""
        self.click(*self.ask("place_of", name))

    def open_sidebar(self, tab: str = "WKS") -> None:
        """Press N over the viewport, and click on a tab."""
        if not self.ask("tab"):
            self.over_viewport()
            self.key("n")
            self.wait_for("tab", patience=10)
        x, y, width, height = self.ask("region", "UI")
        clicks = self.clicks
        for down in range(20, height, 25):
            if self.ask("tab") == tab:
                self.clicks = clicks + (down > 20)  # a person sees where it is
                return
            self.click(x + width - 12, y + down)
        raise WindowError(f"the side panel has no tab {tab}")

    def find(self, name: str) -> tuple[int, int]:
        """Where the button of an operator or property is in the side panel; its sub-panel is opened if need be."""
        found = self.ask("button", name)
        if isinstance(found, list):
            return found[0], found[1]
        # Sub-panels come below the last button. A click on a header opens one, another closes it.
        x, last = max(found.values(), key=lambda place: place[1])
        clicks = self.clicks
        for header in range(last + HEADER, last + 8 * HEADER, HEADER):
            self.click(x, header)
            opened = self.ask("button", name)
            if isinstance(opened, list):
                self.clicks = clicks + 1  # a person reads the title
                return opened[0], opened[1]
            if opened.keys() != found.keys():
                self.click(x, header)
        raise WindowError(f"the side panel has no {name}: {', '.join(sorted(found))}")

    def press(self, name: str) -> None:
        """Click on a button of the side panel."""
        self.click(*self.find(name))

    def enter(self, name: str, text: str) -> None:
        """Give a field of the side panel a value: double click, type, Enter."""
        self.click(*self.find(name), repeat=2)
        self.key("ctrl+a")
        self.type(text)
        self.key("Return")

    def adjust(self, field: int, text: str) -> None:
        """Give a field below the viewport, where the last operator is adjusted, a value; it is opened if need be.

        Fields are counted from 0: of what is there Blender tells nothing.
        """
        x, y, width, height = self.ask("region", "HUD")
        if height < 2 * HEADER:
            self.click(x + width // 2, y + height // 2)
            x, y, width, height = self.ask("region", "HUD")
        self.click(x + int(0.7 * width), y + FIRST_FIELD + FIELD * field, repeat=2)
        self.key("ctrl+a")
        self.type(text)
        self.key("Return")

    def row(self, index: int) -> tuple[int, int]:
        """Where the name of a segment in the list is."""
        x, y = self.find("active_segment")
        return x, y + ROW * index

    def choose(self, name: str, letter: str) -> None:
        """Open a menu of the side panel and press the letter that is underlined in an item."""
        self.press(name)
        self.key(letter)
        self.clicks += 1  # a person clicks

    def over_viewport(self) -> None:
        """Move the mouse to where keys mean the viewport."""
        x, y, width, height = self.ask("region", "WINDOW")
        self.move(x + width // 2, y + height - 40)  # beside the last operator

    def _run_along(self, *command: str) -> None:
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
            "BLENDER_USER_RESOURCES": "/window/user",  # a new user's
            "PYTHONUNBUFFERED": "1",
            "PATH": "/usr/bin:/bin",
        }
        # Lines as LANG=… are arguments of env.
        variables = [f"{name}={value}" for name, value in environment.items()]
        return ["chroot", str(self.root), "env", "-i", *variables, *map(str, command)]
