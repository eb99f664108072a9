"""The operators, one file each."""

from .apply import WKS_SEGMENT_OT_apply
from .bake import WKS_SEGMENT_OT_bake
from .cancel import WKS_SEGMENT_OT_cancel
from .clear import WKS_SEGMENT_OT_clear
from .learn import WKS_SEGMENT_OT_learn
from .load_model import WKS_SEGMENT_OT_load_model
from .save_model import WKS_SEGMENT_OT_save_model
from .segments_from import WKS_SEGMENT_OT_segments_from
from .separate import WKS_SEGMENT_OT_separate
from .transfer import WKS_SEGMENT_OT_transfer
from .unwrap import WKS_SEGMENT_OT_unwrap

CLASSES = (
    WKS_SEGMENT_OT_learn,
    WKS_SEGMENT_OT_apply,
    WKS_SEGMENT_OT_cancel,
    WKS_SEGMENT_OT_clear,
    WKS_SEGMENT_OT_bake,
    WKS_SEGMENT_OT_unwrap,
    WKS_SEGMENT_OT_separate,
    WKS_SEGMENT_OT_transfer,
    WKS_SEGMENT_OT_segments_from,
    WKS_SEGMENT_OT_save_model,
    WKS_SEGMENT_OT_load_model,
)
