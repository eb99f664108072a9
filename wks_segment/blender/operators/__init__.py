"""The operators, one file each."""

from .apply import WKS_SEGMENT_OT_apply
from .cancel import WKS_SEGMENT_OT_cancel
from .clear import WKS_SEGMENT_OT_clear
from .learn import WKS_SEGMENT_OT_learn
from .load_model import WKS_SEGMENT_OT_load_model
from .save_model import WKS_SEGMENT_OT_save_model
from .update import WKS_SEGMENT_OT_update

CLASSES = (
    WKS_SEGMENT_OT_learn,
    WKS_SEGMENT_OT_apply,
    WKS_SEGMENT_OT_cancel,
    WKS_SEGMENT_OT_update,
    WKS_SEGMENT_OT_clear,
    WKS_SEGMENT_OT_save_model,
    WKS_SEGMENT_OT_load_model,
)
