"""Packages are found by the names in their package.xml."""

from __future__ import annotations

from pathlib import Path

from services.script.workspace import workspace_of


def package(folder: Path, name: str, *files: str) -> Path:
    folder.mkdir(parents=True)
    (folder / "package.xml").write_text(f"<package><name> {name} </name></package>")
    for each in files:
        (folder / each).parent.mkdir(parents=True, exist_ok=True)
        (folder / each).write_text("")
    return folder


def test_the_packages_of_a_workspace_are_found_by_name(tmp_path: Path) -> None:
    source = tmp_path / "ws/src"
    one = package(source / "folder_one", "one", "src/one/__init__.py", "scripts/go.py")
    two = package(source / "repo/deep/two", "two", "src/module.py")
    package(source / "ignored", "ignored", "CATKIN_IGNORE")
    package(one / "inner", "inner")
    (source / "loop").symlink_to(source)
    (tmp_path / "ws/build/three").mkdir(parents=True)
    for place in (one / "scripts/go.py", one, source, tmp_path / "ws"):
        found = workspace_of(place, {})
        assert found.packages() == {"one": one, "two": two}, place
        assert found.package_path("two") == two
        assert found.package_path("ignored") is None
    assert workspace_of(two / "src/module.py", {}).python_paths() == (two / "src", one / "src")
    assert workspace_of(two / "src/module.py", {}).own == two


def test_modules_lie_where_setup_py_says(tmp_path: Path) -> None:
    one = package(tmp_path / "src/one", "one", "common/src/one/__init__.py", "lib/helper.py", "elsewhere/two.py")
    (one / "setup.py").write_text(
        "d = generate_distutils_setup(packages=['one'],\n  package_dir={'one': 'common/src/one', \"\": 'lib',\n"
        "  'two': 'elsewhere'})"
    )
    assert workspace_of(one / "lib/helper.py", {}).python_paths() == (one / "common/src", one / "lib")


def test_a_cloned_repository_and_sourced_workspaces_count(tmp_path: Path) -> None:
    repository = tmp_path / "repo"
    (repository / ".git").mkdir(parents=True)
    gazebo = package(repository / "sims/robot_gazebo", "robot_gazebo")
    description = package(repository / "robot_description", "robot_description")
    assert set(workspace_of(gazebo, {}).packages()) == {"robot_gazebo", "robot_description"}
    listed = package(tmp_path / "listed/other", "other")
    copy = package(tmp_path / "sourced/src/robot_description", "robot_description")
    installed = package(tmp_path / "install/share/third", "third")
    (tmp_path / "devel").mkdir()
    (tmp_path / "devel/.catkin").write_text(str(tmp_path / "sourced/src"))
    environment = {
        "ROS_PACKAGE_PATH": f"{tmp_path / 'listed'}:{tmp_path / 'nowhere'}",
        "CMAKE_PREFIX_PATH": f"{tmp_path / 'devel'}:{tmp_path / 'install'}",
    }
    found = workspace_of(gazebo, environment).packages()
    assert found["robot_description"] == description, "the workspace of the file comes first"
    assert (found["other"], found["third"]) == (listed, installed)
    old = tmp_path / "rosbuild/basics"
    (old / "src").mkdir(parents=True)
    (old / "manifest.xml").write_text("<package/>")
    assert workspace_of(old / "src/talker.py", {}).packages() == {"basics": old}
    lone = tmp_path / "lone.py"
    assert workspace_of(lone, environment).packages()["robot_description"] == copy
    assert workspace_of(lone, {}).own is None
