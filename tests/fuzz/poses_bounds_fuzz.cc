#include "core/dataset/poses_bounds.h"
#include "tests/fuzz/fuzz_target.h"
#include "tests/fuzz/pose_index.h"

PEPESEG_FUZZ_TARGET(poses_bounds) {
  static pepeseg::fuzz::PoseIndex index("poses_bounds.npy");
  (void)pepeseg::ReadPosesBounds(index.Put(bytes));
}
