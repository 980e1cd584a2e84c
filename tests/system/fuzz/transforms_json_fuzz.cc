#include "core/dataset/transforms_json.h"
#include "tests/system/fuzz/fuzz_target.h"
#include "tests/system/fuzz/pose_index.h"

PEPESEG_FUZZ_TARGET(transforms_json) {
  static pepeseg::fuzz::PoseIndex index("transforms.json");
  (void)pepeseg::ReadTransformsJson(index.Put(bytes));
}
