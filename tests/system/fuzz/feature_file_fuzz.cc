#include "core/model_files/model_file.h"
#include "tests/system/fuzz/fuzz_target.h"
#include "tests/system/fuzz/memory_file.h"

PEPESEG_FUZZ_TARGET(feature_file) {
  static pepeseg::fuzz::MemoryFile file;
  const auto field = pepeseg::ReadFeatureFile(file.Put(bytes), "features.bin");
  if (!field.ok()) return;
  pepeseg::fuzz::Expect(2 * field->features.size() <= bytes.size(), "features that are there");
}
