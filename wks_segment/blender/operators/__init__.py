"""The operators, one file each."""

from .accept import WKS_SEGMENT_OT_accept
from .apply import WKS_SEGMENT_OT_apply
from .cancel import WKS_SEGMENT_OT_cancel
from .clear import WKS_SEGMENT_OT_clear
from .discard import WKS_SEGMENT_OT_discard
from .learn import WKS_SEGMENT_OT_learn
from .load_model import WKS_SEGMENT_OT_load_model
from .save_model import WKS_SEGMENT_OT_save_model
from .update import WKS_SEGMENT_OT_update

CLASSES = (
    WKS_SEGMENT_OT_learn,
    WKS_SEGMENT_OT_apply,
    WKS_SEGMENT_OT_cancel,
    WKS_SEGMENT_OT_update,
    WKS_SEGMENT_OT_accept,
    WKS_SEGMENT_OT_discard,
    WKS_SEGMENT_OT_clear,
    WKS_SEGMENT_OT_save_model,
    WKS_SEGMENT_OT_load_model,
)
