"""Launch files are parsed as by roslaunch."""

from __future__ import annotations

from pathlib import Path

import pytest

from deploy.launch.launch_file import LaunchNode, declared_arguments
from services.runtime.errors import BadInput
from tests.deploy.launch.launch_harness import LaunchWorkspace


@pytest.fixture
def workspace(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> LaunchWorkspace:
    monkeypatch.setenv("SOME_VARIABLE", "from the shell")
    return LaunchWorkspace(tmp_path)


def nodes(workspace: LaunchWorkspace, text: str, **arguments: str) -> dict[str, LaunchNode]:
    return {each.node: each for each in workspace.read(text, arguments).nodes}


def test_arguments_conditions_and_substitutions(workspace: LaunchWorkspace) -> None:
    text = """
      <arg name="x" default="1"/>  <arg name="fixed" value="a$(arg x)"/>  <arg name="flag" default="false"/>
      <arg name="twice" default="$(eval arg('x') * 2 + x)"/>
      <group if="$(arg flag)"><param name="grouped" value="yes"/></group>
      <param unless="$(arg flag)" name="grouped" value="no"/>
      <param name="all" value="$(arg fixed) $(env SOME_VARIABLE) $(optenv NO_SUCH some default)-$(optenv NO_SUCH)"/>
      <param name="place" value="$(find robots)/x $(dirname)"/>
      <param name="model" value="$(env TURTLEBOT3_MODEL)"/>
      <param name="twice" value="$(arg twice)"/>
      <param name="same" value="$(anon a) $(anon b) $(anon a)"/>
      <param name="sum" value="$(eval 'big' if x &gt; 2 else 'small')"/>
    """
    read = workspace.read(text, {"x": "3", "flag": "true"}).parameters
    assert read == {
        "grouped": "yes",
        "all": "a3 from the shell some default-",
        "place": f"{workspace.source}/robots/x {workspace.source}/talks/launch",
        "model": "burger",
        "twice": 9,
        "same": "a_1 b_2 a_1",
        "sum": "big",
    }
    assert workspace.read(text).parameters["grouped"] == "no"
    notes = workspace.read(text, {"fixd": "1", "fixed": "b"}).notes
    assert any(
        "fixd:= is given, and test.launch has no <arg> of this name; did you mean 'fixed'?" in each for each in notes
    )
    assert any("'fixed' has a fixed value" in each for each in notes)


def test_values_have_the_types_that_roslaunch_gives_them(workspace: LaunchWorkspace) -> None:
    workspace.write("talks/config/text.txt", "line\n")
    workspace.write(
        "talks/config/gains.yaml", "p: 1\nnested: {i: 0.5, list: [1, two]}\nturn: deg(180)\nhalf: rad(pi/2)\n"
    )
    read = workspace.read("""
      <param name="int" value="1"/> <param name="float" value="1.50"/> <param name="bool" value="True"/>
      <param name="text" value="1.0.0"/> <param name="str" value="1" type="str"/>
      <param name="one" value="1" type="double"/>
      <param name="list" value="[1, 2.5]" type="yaml"/> <param name="file" textfile="$(find talks)/config/text.txt"/>
      <param name="version" command="rosversion -d"/>
      <rosparam file="$(find talks)/config/gains.yaml" command="load" ns="pid"/>
      <rosparam param="names">[a, $(find robots)]</rosparam>
      <rosparam>
        pid/d: 4
        date: 2020-01-01
      </rosparam>
      <rosparam command="delete" param="names_of_nobody"/>
    """).parameters
    assert read.pop("pid") == {
        "p": 1, "nested": {"i": 0.5, "list": [1, "two"]}, "turn": pytest.approx(3.14159, abs=1e-5),
        "half": pytest.approx(1.5708, abs=1e-4), "d": 4,
    }  # fmt: skip
    assert read == {
        "int": 1, "float": 1.5, "bool": True, "text": "1.0.0", "str": "1", "one": 1.0, "list": [1, 2.5],
        "file": "line\n", "version": "noetic\n", "names": ["a", str(workspace.source / "robots")], "date": "2020-01-01",
    }  # fmt: skip


@pytest.mark.parametrize(
    ("param", "value"),
    [
        ('value=" hello "', "hello"),
        ('value=" 5 "', 5),
        ('value="5" type=" Double "', 5.0),
        ('command="cat $(find talks)/five.txt"', 5),
        ('textfile="$(find talks)/five.txt" type="double"', 5.0),
        ('textfile="$(find talks)/five.txt" type="str"', "5\n"),
        ("value=\"$(eval [int(v) + n for v in '1 2'.split()])\"", "[8, 9]"),
    ],
)
def test_values_are_converted_as_by_roslaunch(workspace: LaunchWorkspace, param: str, value: object) -> None:
    workspace.write("talks/five.txt", "5\n")
    (read,) = workspace.read(f'<arg name="n" value="7"/><param name="x" {param}/>').parameters.values()
    assert (read, type(read)) == (value, type(value))


def test_quoted_arguments_keep_their_blanks(workspace: LaunchWorkspace) -> None:
    node = '<node pkg="talks" type="talker.py" name="n" args="  say\n  \'a  b\'  "/>'
    (found,) = nodes(workspace, node).values()
    assert found.words == ["say", "a  b"]


def test_groups_have_arguments_of_their_own(workspace: LaunchWorkspace) -> None:
    group = '<group ns="{}"><arg name="x" {}/><param name="p" value="$(arg x)$(eval x)"/></group>'
    two = group.format("a", 'value="1"') + group.format("b", 'default="2"')
    read = workspace.read(two, {"x": "3"})
    assert (read.parameters, read.notes[1:]) == ({"a": {"p": 11}, "b": {"p": 33}}, [])
    assert workspace.read(two).parameters == {"a": {"p": 11}, "b": {"p": 22}}
    with pytest.raises(BadInput, match=r"\$\(arg x\): no <arg> of this name is declared"):
        workspace.read(f'{two}<param name="q" value="$(arg x)"/>')
    with pytest.raises(BadInput, match=r"<arg> 'x' is already declared"):
        workspace.read('<arg name="x" value="1"/>' + two)


def test_the_root_namespace_is_that_of_the_command_line_or_of_the_shell(
    workspace: LaunchWorkspace, monkeypatch: pytest.MonkeyPatch
) -> None:
    text = """<node pkg="talks" type="talker.py" name="n"><param name="p" value="1"/></node><param name="/q" value="2"/>
      <node pkg="talks" type="talker.py" name="m" ns="/abs"/>"""
    monkeypatch.setenv("ROS_NAMESPACE", "tb3_0")
    read = workspace.read(text)
    assert [each.node for each in read.nodes] == ["/tb3_0/n", "/abs/m"]
    assert read.parameters == {"tb3_0": {"n": {"p": 1}}, "q": 2}
    read = workspace.read(text, {"__ns": "/other"})
    assert ([each.node for each in read.nodes], read.notes) == (["/other/n", "/abs/m"], [])
    monkeypatch.setenv("ROS_NAMESPACE", "")
    assert workspace.read(text).nodes[0].node == "/n"


def test_names_remapping_and_private_parameters_follow_their_scopes(workspace: LaunchWorkspace) -> None:
    found = nodes(
        workspace,
        """
      <remap from="everywhere" to="/e"/>  <env name="A" value="1"/>  <param name="~shared" value="5"/>
      <group ns="outer">
        <remap from="chatter" to="news"/>
        <node pkg="talks" type="talker.py" name="one" ns="inner" args="a  b" respawn="true" respawn_delay="2">
          <remap from="~own/" to="/abs//olute"/>  <param name="rate" value="2"/>  <env name="B" value="2"/>
          <rosparam>{x: {y: 1}}</rosparam>
        </node>
        <node pkg="talks" type="talker.py" name="two" ns="/" required="true" launch-prefix="xterm -e" cwd="node"/>
      </group>
      <node pkg="talks" type="listener" name="three"/>
    """,
    )
    assert set(found) == {"/outer/inner/one", "/two", "/three"}
    one, two, three = found["/outer/inner/one"], found["/two"], found["/three"]
    assert dict(one.remaps) == {"everywhere": "/e", "chatter": "news", "~own": "/abs/olute"}
    assert dict(one.environment) == {"A": "1", "B": "2"}
    assert (one.args, one.respawn, one.respawn_delay) == ("a b", True, 2.0)
    assert (two.required, two.prefix, two.cwd) == (True, "xterm -e", "node")
    assert dict(three.remaps) == {"everywhere": "/e"}
    tree = workspace.read(
        '<node pkg="talks" type="talker.py" name="n" ns="a"><param name="~p" value="1"/></node>'
    ).parameters
    assert tree == {"a": {"n": {"p": 1}}}
    gains = '<rosparam param="~/gains">{p: 1}</rosparam><rosparam param="~limits">{v: 2}</rosparam>'
    tree = workspace.read(f'<node pkg="talks" type="talker.py" name="n" ns="a">{gains}</node>').parameters
    assert tree == {"a": {"n": {"gains": {"p": 1}, "limits": {"v": 2}}}}


def test_includes_have_arguments_and_namespaces_of_their_own(workspace: LaunchWorkspace) -> None:
    workspace.launch_file(
        '<arg name="name"/><arg name="other" default="d"/><node pkg="talks" type="talker.py" name="$(arg name)" '
        'args="$(arg other)"/>',
        "robots/launch/one.launch",
    )
    found = nodes(
        workspace,
        """
      <arg name="name" default="a"/>  <arg name="other" default="passed"/>
      <include file="$(find robots)/launch/one.launch" ns="x"><arg name="name" value="first"/></include>
      <include file="$(find robots)/launch/one.launch" pass_all_args="true"/>
      <include file="../../robots/launch/one.launch" if="false"/>
      <include file="$(find nowhere)/launch/none.launch" unless="true"/>
    """,
    )
    assert {node: each.args for node, each in found.items()} == {"/x/first": "d", "/a": "passed"}
    workspace.launch_file('<param name="mode" value="$(eval mode)"/>', "robots/launch/all.launch")
    include = '<include file="$(find robots)/launch/all.launch" pass_all_args="true"/>'
    assert workspace.read(f'<arg name="mode" default="real"/>{include}').parameters == {"mode": "real"}
    recursive = '<arg name="n" default="3"/><node pkg="talks" type="talker.py" name="n$(arg n)"/>' + (
        '<include if="$(eval n > 1)" file="$(dirname)/test.launch"><arg name="n" value="$(eval n - 1)"/></include>'
    )
    assert set(nodes(workspace, recursive)) == {"/n3", "/n2", "/n1"}


ERRORS = {
    '<arg name="x"/>': r"test\.launch:2: <arg> 'x' has no default and must be given: x:=VALUE",
    '<arg name="x" default="1"/><arg name="x" value="2"/>': r":2: <arg> 'x' is already declared at .*test\.launch:2",
    '<param name="a" value="$(arg y)"/>': r":2: \$\(arg y\): no <arg> of this name is declared before it",
    '<param name="a" value="$(agr y)"/>': r":2: unknown substitution 'agr'; did you mean 'arg'",
    '<param name="a" value="$(arg y"/>': r":2: '\$\(arg y' is not closed",
    '<param name="a" value="$(env NO_SUCH_ONE)"/>': r":2: \$\(env NO_SUCH_ONE\): the variable is not set: export",
    '<param name="a" value="$(find robot)"/>': r":2: there is no package 'robot'; did you mean 'robots'",
    '<param name="a" value="$(eval 1 / 0)"/>': r":2: \$\(eval 1 / 0\): ZeroDivisionError",
    '<param name="a" value="$(eval __import__(1))"/>': r":2: \$\(eval …\) must not have '__' in it",
    '<param name="a" value="x" type="int"/>': r":2: 'x' is not a valid int",
    '<param name="a" value="x" type="integer"/>': r":2: unknown type 'integer'",
    '<param name="a"/>': r":2: <param> 'a' needs one of value, textfile and command, not none",
    '<param name="a" binfile="x"/>': r":2: <param> 'a': binfile is not supported",
    '<param name="a" command="ls /"/>': r":2: the command 'ls' is not run: only xacro, cat and rosversion",
    '<param name="a" textfile="/nowhere.txt"/>': r":2: <param> 'a': /nowhere\.txt cannot be read",
    "\n<rosparam>a: [1</rosparam>": r"test\.launch:3: YAML, line 1",
    '<rosparam file="/nowhere.yaml"/>': r":2: <rosparam>: /nowhere\.yaml cannot be read",
    "<rosparam>5</rosparam>": r":2: <rosparam> has a single value, '5': param names it",
    '<node pkg="a" type="b"/>': r":2: <node> needs the attribute 'name'",
    '<node pkg="a" typ="b" name="c"/>': r":2: <node> needs the attribute 'type'; did you mean 'typ'",
    '<node pkg="a" type="b" name="c" respawn="perhaps"/>': r":2: respawn='perhaps' is neither true nor false",
    '<remap from="a b" to="c"/>': r":2: <remap>: .*'a b'",
    '<machine name="m" address="10.0.0.5"/>': r":2: <machine> 'm': nodes are not started elsewhere \(10\.0\.0\.5\)",
    '<include file="$(find robots)/launch/gone.launch"/>': r":2: <include>: there is no file .*gone\.launch",
    '<include file="$(dirname)/test.launch"/>': r":2: too many includes .*: test\.launch includes itself: ",
    '<node pkg="a" type="b" name="c"/>\n<node pkg="d" type="e" name="c"/>': r":3: a node /c is already started at .*:2",
    '<group if="maybe"/>': r":2: if='maybe' is neither true nor false",
    '<group if="1" unless="0"/>': r":2: <group> has both if and unless",
}


def test_what_is_wrong_is_told_with_file_and_line(workspace: LaunchWorkspace) -> None:
    for text, said in ERRORS.items():
        with pytest.raises(BadInput, match=said):
            workspace.read(text)
    workspace.launch_file('<arg name="known" default="1"/>', "robots/launch/one.launch")
    with pytest.raises(BadInput, match=r":2: <include>: one\.launch has no <arg> 'knwon'; did you mean 'known'"):
        workspace.read('<include file="$(find robots)/launch/one.launch"><arg name="knwon" value="2"/></include>')


def test_what_roslaunch_passes_over_is_left_out_with_a_note(workspace: LaunchWorkspace) -> None:
    workspace.launch_file('<arg name="x" default="1"/>', "robots/launch/one.launch")
    launch = workspace.read(
        """
      <node pkg="talks" type="talker.py" name="a" respwan="true"><arg name="b" value="1"/></node>
      <nod pkg="talks" type="talker.py" name="c"/>
      <include file="$(find robots)/launch/one.launch"><param name="y" value="2"/></include>
    """
    )
    assert [each.name for each in launch.nodes] == ["a"]
    found = {note.partition("test.launch:")[2] for note in launch.notes}
    assert found == {
        "3: <node> has no attribute 'respwan'; did you mean 'respawn'?; it is ignored",
        "3: <arg> is not a launch file's element; it is ignored",
        "4: <nod> is not a launch file's element; did you mean 'node'?; it is ignored",
        "5: <param> is not a launch file's element; it is ignored",
    }


def test_what_copying_did_to_a_file_is_told(workspace: LaunchWorkspace) -> None:
    cases = {
        '<launch>\n<node name="a"</pre>\n pkg="b"/>\n</launch>': r":2: this is not XML: .*line 2 has '</pre>'",
        '<launch>\n<param name="a" value=“b”/>\n</launch>': r":2: this is not XML: .*has '“'.*in place of '\"'",
        "<launch>\n<group>\n</launch>": r":3: this is not XML: mismatched tag \(<group> of line 2 is still open\)",
        '<launch>\n<param name="a" value="b & c"/>\n</launch>': r":2: .*line 2 has a bare '&'",
        '<launch>\n<node\n13\n name="a"/></launch>': r":3: .*line 3 begins with a number",
        "<robot/>": r":1: the root element is <robot>, not <launch>",
        '<!DOCTYPE a [<!ENTITY b "c">]>\n<launch/>': r":1: the file declares a document type",
        "": r":1: this is not XML: no element found",
    }
    for text, said in cases.items():
        path = workspace.write("talks/launch/bad.launch", text)
        with pytest.raises(BadInput, match=said):
            declared_arguments(path)


def test_arguments_are_listed_with_their_docs(workspace: LaunchWorkspace) -> None:
    path = workspace.launch_file(
        '<arg name="a" doc="what it is"/><group><arg name="b" default="1"/></group><arg name="c" value="2"/>'
    )
    found = [(each.name, each.default, each.value, each.doc) for each in declared_arguments(path)]
    assert found == [("a", None, None, "what it is"), ("b", "1", None, ""), ("c", None, "2", "")]
