// Writes a miniature of each benchmark's folder.
//   write_miniatures FOLDER
#include <gtest/gtest.h>

#include <filesystem>

#include "tests/testing/benchmark_miniatures.h"

int main(int argc, char** argv) {
  ::testing::InitGoogleTest(&argc, argv);  // the writers use its assertions
  if (argc != 2) return 2;
  const std::filesystem::path folder = argv[1];
  pepeseg::testing::WriteNvosMiniature(folder / "nvos");
  pepeseg::testing::WriteSpinNerfMiniature(folder / "spin-nerf");
  pepeseg::testing::WriteLerfMaskMiniature(folder / "lerf-mask");
  pepeseg::testing::WriteOwnMiniature(folder / "scene");
  return 0;
}
