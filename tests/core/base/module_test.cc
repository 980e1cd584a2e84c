#include "core/base/module.h"

#include <gtest/gtest.h>

#include "tests/testing/status_testing.h"

namespace pepeseg {
namespace {

TEST(Modules, LieNextToTheFolderOfTheProgram) {
  const auto program = std::filesystem::canonical("/proc/self/exe");
  EXPECT_EQ(ModulePath("video"),
            program.parent_path().parent_path() / "lib" / "pepeseg" / "video.so");
}

TEST(Modules, ThatAreMissingAreNamedInTheError) {
  EXPECT_STATUS(LoadModule("none", "Any"), absl::StatusCode::kFailedPrecondition,
                "the module none cannot be loaded: ");
}

}  // namespace
}  // namespace pepeseg
