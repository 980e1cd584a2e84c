#include "absl/strings/str_cat.h"
#include "core/base/digest.h"
#include "core/features/checkpoint.h"
#include "core/model_files/checkpoint.h"
#include "core/reconstruct/checkpoint.h"
#include "tests/system/fuzz/fuzz_target.h"
#include "tests/system/fuzz/memory_file.h"

namespace {

void Read(const std::string& path) {
  const auto checkpoint = pepeseg::ReadCheckpoint(path);
  if (!checkpoint.ok()) return;
  const auto reconstruct = pepeseg::GaussianCheckpoint::Read(checkpoint->sections);
  if (reconstruct.ok()) (void)pepeseg::Validate(*reconstruct);
  const auto features = pepeseg::FeatureCheckpoint::Read(checkpoint->sections);
  if (features.ok()) (void)pepeseg::Validate(*features);
}

}  // namespace

// Reads the bytes as they are, and with the right digest at the end, which no fuzzer finds.
PEPESEG_FUZZ_TARGET(checkpoint) {
  static pepeseg::fuzz::MemoryFile file;
  Read(file.Put(bytes));
  Read(file.Put(absl::StrCat(bytes, pepeseg::Sha256Hex({bytes.data(), bytes.size()}))));
}
