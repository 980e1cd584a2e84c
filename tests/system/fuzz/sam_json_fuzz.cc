#include "core/dataset/mask_files.h"
#include "tests/system/fuzz/fuzz_target.h"
#include "tests/system/fuzz/memory_file.h"

PEPESEG_FUZZ_TARGET(sam_json) {
  static pepeseg::fuzz::MemoryFile file;
  const auto masks = pepeseg::ReadMasks(file.Put(bytes), "a.json", {"a.jpg", 8, 6});
  if (!masks.ok()) return;
  pepeseg::fuzz::Expect(masks->num_masks <= pepeseg::kMaxMasksOfView, "masks within the limit");
}
