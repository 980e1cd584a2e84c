#include "absl/strings/str_cat.h"
#include "core/base/digest.h"
#include "core/model_files/model_file.h"
#include "tests/system/fuzz/fuzz_target.h"
#include "tests/system/fuzz/memory_file.h"

// Reads the bytes as they are, and with the right digest at the end, which no fuzzer finds.
PEPESEG_FUZZ_TARGET(selection_file) {
  static pepeseg::fuzz::MemoryFile file;
  (void)pepeseg::ReadSelectionFile(file.Put(bytes), "a.selection");
  const std::string digest = pepeseg::Sha256Hex({bytes.data(), bytes.size()});
  const auto set = pepeseg::ReadSelectionFile(file.Put(absl::StrCat(bytes, digest)), "a.selection");
  if (set.ok()) pepeseg::fuzz::Expect(set->member.size() <= 8 * bytes.size(), "a bit a Gaussian");
}
