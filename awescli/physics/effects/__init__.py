"""EFFECTS: the table of all effects. A new effect is one file and one line here."""

from awescli.physics.effects.actuator_delay import ActuatorDelay
from awescli.physics.effects.actuator_lag import ActuatorLag
from awescli.physics.effects.added_mass import AddedMass
from awescli.physics.effects.aerodynamics import Aerodynamics
from awescli.physics.effects.aeroelastic_twist import AeroelasticTwist
from awescli.physics.effects.air_density import AirDensity
from awescli.physics.effects.airspeed_lag import AirspeedLag
from awescli.physics.effects.airspeed_scale import AirspeedScale
from awescli.physics.effects.antenna_arm import AntennaArm
from awescli.physics.effects.attitude_bias import AttitudeBias
from awescli.physics.effects.attitude_latency import AttitudeLatency
from awescli.physics.effects.clock_offset import ClockOffset
from awescli.physics.effects.compass_deviation import CompassDeviation
from awescli.physics.effects.custom_term import CustomTerm
from awescli.physics.effects.downwash_lag import DownwashLag
from awescli.physics.effects.gravity import Gravity
from awescli.physics.effects.heading_bias import HeadingBias
from awescli.physics.effects.hinge_blowback import HingeBlowback
from awescli.physics.effects.imu_arm import ImuArm
from awescli.physics.effects.imu_bias import ImuBias
from awescli.physics.effects.imu_misalignment import ImuMisalignment
from awescli.physics.effects.lift_drift import LiftDrift
from awescli.physics.effects.lift_stall import LiftStall
from awescli.physics.effects.load_cell_lag import LoadCellLag
from awescli.physics.effects.load_cell_scale import LoadCellScale
from awescli.physics.effects.mass_offset import MassOffset
from awescli.physics.effects.parasitic_drag import ParasiticDrag
from awescli.physics.effects.pitch_curvature import PitchCurvature
from awescli.physics.effects.pitot_position_error import PitotPositionError
from awescli.physics.effects.position_latency import PositionLatency
from awescli.physics.effects.probe_arm import ProbeArm
from awescli.physics.effects.rate_feedback import RateFeedback
from awescli.physics.effects.reynolds_drag import ReynoldsDrag
from awescli.physics.effects.sideslip_drag import SideslipDrag
from awescli.physics.effects.surface_backlash import SurfaceBacklash
from awescli.physics.effects.surface_bias import SurfaceBias
from awescli.physics.effects.surface_dead_band import SurfaceDeadBand
from awescli.physics.effects.surface_effectiveness import SurfaceEffectiveness
from awescli.physics.effects.tether import Tether
from awescli.physics.effects.tether_attachment import TetherAttachment
from awescli.physics.effects.tether_drag import TetherDrag
from awescli.physics.effects.tether_elasticity import TetherElasticity
from awescli.physics.effects.tether_sag import TetherSag
from awescli.physics.effects.tether_weight import TetherWeight
from awescli.physics.effects.thrust import Thrust
from awescli.physics.effects.turbulence import Turbulence
from awescli.physics.effects.unsteady_lift import UnsteadyLift
from awescli.physics.effects.vane_bias import VaneBias
from awescli.physics.effects.winch_control import WinchControl
from awescli.physics.effects.winch_length import WinchLength
from awescli.physics.effects.winch_tracking import WinchTracking
from awescli.physics.effects.wind_offset import WindOffset
from awescli.physics.effects.wind_shear import WindShear
from awescli.physics.effects.wind_veer import WindVeer

EFFECTS = {
    e.name: e
    for e in (
        Gravity, Aerodynamics, Thrust, Tether,
        WindShear, WindVeer, WindOffset, AirDensity, Turbulence,
        TetherDrag, TetherWeight, TetherElasticity, TetherSag, TetherAttachment,
        WinchControl, WinchLength, WinchTracking, ClockOffset,
        MassOffset, AddedMass,
        ParasiticDrag, SideslipDrag, ReynoldsDrag, LiftStall, LiftDrift, PitchCurvature, UnsteadyLift, DownwashLag,
        AeroelasticTwist, SurfaceBias,
        RateFeedback, SurfaceEffectiveness, SurfaceDeadBand, SurfaceBacklash, HingeBlowback, ActuatorLag, ActuatorDelay,
        ProbeArm, VaneBias, AirspeedScale, AirspeedLag, PitotPositionError, LoadCellScale, LoadCellLag,
        PositionLatency, HeadingBias, CompassDeviation, AttitudeBias, AttitudeLatency, AntennaArm, ImuArm, ImuMisalignment, ImuBias,
        CustomTerm,
    )
}  # fmt: skip
