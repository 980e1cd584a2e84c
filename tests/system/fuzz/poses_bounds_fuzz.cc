#include "core/dataset/photo_poses.h"
#include "tests/system/fuzz/fuzz_target.h"
#include "tests/system/fuzz/pose_index.h"

PEPESEG_FUZZ_TARGET(poses_bounds) {
  static pepeseg::fuzz::PoseIndex index("poses_bounds.npy");
  (void)pepeseg::ReadPosesBounds(index.Put(bytes));
}
