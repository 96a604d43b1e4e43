"""The exception tree; classes of other modules are listed with the module's name.

EleaError
├── BadInput (ValueError)        a file, flag, name or value from outside is wrong       -> exit status 2
│   ├── TryAgain                 wrong for now: a name in use, an unreachable network     -> exit status 75
│   ├── BadName                  messages.names: not a legal ROS name or remapping rule
│   ├── UnknownRecord            messages.records: no record has this name (LookupError)
│   ├── BadDefinition            messages.interfaces.definition: the text of a message type cannot be read
│   ├── UnknownType              messages.interfaces.catalogue: no message, service or action has this name
│   ├── UnknownModel             models: no robot or world has this name
│   ├── BadWorld                 models.bodies: a world's file, or one that it names, cannot be read
│   ├── BadUrdf                  models.urdf: a URDF cannot be read
│   │   └── UnreadMesh           models.shapes: a mesh of a URDF is missing or bad
│   ├── BadMesh                  models.mesh: a mesh cannot be read, or is too large
│   ├── BadXacro                 models.xacro_file: a xacro cannot be expanded
│   ├── FileNotAllowed           models.packages: a robot's description names a file that it may not read
│   │   └── FileMissing          models.packages: a package, model or file that is not on this machine
│   ├── BadConfig                services.script.reconfigure_config: a dynamic_reconfigure file is wrong
│   ├── BadTrajectory            services.controller_manager.trajectory_message: a trajectory cannot be followed
│   ├── NoWheels                 models.urdf: a robot has no two wheels to drive on
│   └── ParameterConflict        services.params.schema: two nodes contradict each other about a parameter
├── WrongPayload (ValueError)    messages.base: a payload is not the expected record
├── NotWritable (ValueError)     messages.cdr.write: a message cannot be written as CDR
├── CallFailed (RuntimeError)    a request was refused, or not answered in time
│   ├── NoAnswer                 it has no server, or was not answered in time
│   ├── SeveralServers           more than one process answered it
│   └── OutcomeUnknown           services.runtime.parameters.client: it may have been carried out, or not
├── NoTransform (LookupError)    a transform between two frames cannot be found
│   ├── UnknownFrame             no transform mentions this frame
│   ├── NotConnected             the two frames are in different trees
│   ├── Extrapolation            the time is outside what is known
│   └── FrameLoop                a frame is its own ancestor
├── SaveError                    services.params.store: a change of parameters could not be written
├── RecordingIncomplete          services.recorder.loop: part of what was to be recorded is missing
├── PlaybackIncomplete           services.player.loop: part of a bag was not played, or had no subscribers
├── IncompleteBag                deploy.commands.bag: a bag is damaged, or not all of it could be used
├── ScriptStopped                services.script.api: a script's wait ends, as its process is asked to end
├── TimeMovedBackwards           services.script.api: simulation time was reset while a script slept
├── ServiceUnavailable           services.script.api: no node serves the name that a script calls
├── ServiceRefused               services.script.api: the server of a script's call answered with an error
├── NodeFailed                   services.runtime.composition.container: a node of a container raised an error
├── NoKernel                     services.script.api: a client library was imported where no script runs
└── Stopped                      the process was asked to end; unwinds the loop          -> exit status 0
"""

from __future__ import annotations

from messages.errors import BadInput as BadInput
from messages.errors import EleaError as EleaError
from messages.errors import did_you_mean as did_you_mean
from messages.errors import list_names as list_names
from messages.errors import missing_file as missing_file
from messages.errors import nearest as nearest
from messages.errors import unknown_name as unknown_name

TRY_AGAIN = 75
"""Exit status after TryAgain: EX_TEMPFAIL of sysexits(3)."""


class TryAgain(BadInput):
    """The request is valid but not possible now; the same may work a moment later."""


class CallFailed(EleaError, RuntimeError):
    """A request got an error reply, or no reply within its deadline."""


class NoAnswer(CallFailed):
    """A request has no server, or was not answered in time."""


class SeveralServers(CallFailed):
    """More than one process answered a request: the right answer is unknown, and all may have carried it out."""


class NoTransform(EleaError, LookupError):
    """A transform between two frames cannot be found; the text says why, and lists the alternatives."""


class UnknownFrame(NoTransform):
    """No transform mentions this frame."""


class NotConnected(NoTransform):
    """No chain of transforms leads from one frame to the other."""


class Extrapolation(NoTransform):
    """The time is before the oldest or after the newest transform of a frame."""


class FrameLoop(NoTransform):
    """A frame is its own ancestor, so its pose is undefined."""


class Stopped(EleaError):
    """The process was asked to end."""
