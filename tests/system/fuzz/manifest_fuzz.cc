#include <fstream>

#include "core/model_files/manifest.h"
#include "tests/system/fuzz/fuzz_target.h"
#include "tests/testing/temp_folder.h"

PEPESEG_FUZZ_TARGET(manifest) {
  static const pepeseg::testing::TempFolder folder;
  std::ofstream(folder / pepeseg::kManifestName, std::ios::binary) << bytes;
  const auto manifest = pepeseg::ReadManifest(folder.path());
  if (!manifest.ok()) return;
  (void)pepeseg::VerifyManifest(folder.path(), *manifest);
}
