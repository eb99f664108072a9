"""The operators, one file each."""

from .accept import WKS_SEGMENT_OT_accept
from .apply import WKS_SEGMENT_OT_apply
from .apply_ranked import WKS_SEGMENT_OT_apply_ranked
from .assign_faces import WKS_SEGMENT_OT_assign_faces, WKS_SEGMENT_OT_forget_faces, WKS_SEGMENT_OT_new_segment
from .bake import WKS_SEGMENT_OT_bake
from .cancel import WKS_SEGMENT_OT_cancel
from .clear import WKS_SEGMENT_OT_clear
from .discard import WKS_SEGMENT_OT_discard
from .learn import WKS_SEGMENT_OT_learn
from .load_model import WKS_SEGMENT_OT_load_model
from .merge_segments import WKS_SEGMENT_OT_merge_segments
from .model_list import WKS_SEGMENT_OT_duplicate_model, WKS_SEGMENT_OT_remove_model, WKS_SEGMENT_OT_use_model
from .name_segment import WKS_SEGMENT_OT_name_segment
from .rank import WKS_SEGMENT_OT_rank
from .restore_segments import WKS_SEGMENT_OT_refresh_segments, WKS_SEGMENT_OT_restore_segments
from .save_model import WKS_SEGMENT_OT_save_model
from .segments_from import WKS_SEGMENT_OT_segments_from
from .select_segment import WKS_SEGMENT_OT_select_segment
from .separate import WKS_SEGMENT_OT_separate
from .show_segments import WKS_SEGMENT_OT_hide_segment, WKS_SEGMENT_OT_isolate_segment, WKS_SEGMENT_OT_show_segments
from .split_segment import WKS_SEGMENT_OT_split_segment
from .transfer import WKS_SEGMENT_OT_transfer
from .unwrap import WKS_SEGMENT_OT_unwrap
from .update import WKS_SEGMENT_OT_update

CLASSES = (
    WKS_SEGMENT_OT_learn,
    WKS_SEGMENT_OT_apply,
    WKS_SEGMENT_OT_cancel,
    WKS_SEGMENT_OT_update,
    WKS_SEGMENT_OT_accept,
    WKS_SEGMENT_OT_discard,
    WKS_SEGMENT_OT_clear,
    WKS_SEGMENT_OT_bake,
    WKS_SEGMENT_OT_unwrap,
    WKS_SEGMENT_OT_separate,
    WKS_SEGMENT_OT_transfer,
    WKS_SEGMENT_OT_segments_from,
    WKS_SEGMENT_OT_save_model,
    WKS_SEGMENT_OT_load_model,
    WKS_SEGMENT_OT_use_model,
    WKS_SEGMENT_OT_duplicate_model,
    WKS_SEGMENT_OT_remove_model,
    WKS_SEGMENT_OT_rank,
    WKS_SEGMENT_OT_apply_ranked,
    WKS_SEGMENT_OT_select_segment,
    WKS_SEGMENT_OT_hide_segment,
    WKS_SEGMENT_OT_isolate_segment,
    WKS_SEGMENT_OT_show_segments,
    WKS_SEGMENT_OT_name_segment,
    WKS_SEGMENT_OT_merge_segments,
    WKS_SEGMENT_OT_split_segment,
    WKS_SEGMENT_OT_restore_segments,
    WKS_SEGMENT_OT_refresh_segments,
    WKS_SEGMENT_OT_assign_faces,
    WKS_SEGMENT_OT_new_segment,
    WKS_SEGMENT_OT_forget_faces,
)
