"""The kernel of a service process: transport, time, inputs and outputs, requests, parameters, log."""

from services.runtime.errors import BadInput, CallFailed, EleaError, Stopped
from services.runtime.main import main
from services.runtime.parameters.base import Parameters
from services.runtime.service import Service

__all__ = ["BadInput", "CallFailed", "EleaError", "Parameters", "Service", "Stopped", "main"]
