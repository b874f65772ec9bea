"""PROCESSES: the table of all processes. A new one is one file and one line here."""

from awescli.estimation.processes.drift import Drift
from awescli.estimation.processes.gusts import Gusts
from awescli.estimation.processes.line import LineLength
from awescli.estimation.processes.model_error import ModelError
from awescli.estimation.processes.pitch_yaw_gusts import PitchYawGusts
from awescli.estimation.processes.roll_gusts import RollGusts
from awescli.estimation.processes.surface_noise import SurfaceNoise
from awescli.estimation.processes.winch_noise import WinchNoise
from awescli.estimation.processes.wind_record import WindRecord

PROCESSES = {p.name: p for p in (WindRecord, Gusts, RollGusts, PitchYawGusts, ModelError, Drift, LineLength, SurfaceNoise, WinchNoise)}
