from .bench.closed_loop import Controller as Controller
from .bench.closed_loop import run_loops as run_loops
from .bench.rig import Rig as Rig
from .bench.rig import two_axis_stage as two_axis_stage
from .bench.run import run as run
from .bench.servo import ServoAxis as ServoAxis
from .bench.servo import simulate_servo as simulate_servo
from .bench.trajectory import Trajectory as Trajectory
