"""The torque controllers that a run spec can name."""

from fzcli.control.torque import computed_torque, joint_pd, robust, transposed_jacobian
from fzcli.control.torque.law import TorqueController

_OWN = (
    TorqueController(joint_pd.JointPdSpec, joint_pd.build),
    TorqueController(computed_torque.ComputedTorqueSpec, computed_torque.build),
    TorqueController(transposed_jacobian.TransposedJacobianSpec, transposed_jacobian.build),
    TorqueController(robust.RobustSpec, robust.build),
)
TORQUE_CONTROLLERS = {str(entry.spec.model_fields["kind"].default): entry for entry in _OWN}
