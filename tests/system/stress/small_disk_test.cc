// Runs a scene's life on a real disk that is too small for it, so that each step in turn meets the
// full disk. The disk is a tmpfs in a mount namespace of this process, which needs root.
#include <gtest/gtest.h>
#include <sched.h>
#include <sys/mount.h>
#include <unistd.h>

#include <iostream>
#include <map>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "tests/server/pepesegd_process.h"
#include "tests/system/stress/life_of_a_scene.h"
#include "tests/system/stress/unclean_data.h"
#include "tests/testing/eventually.h"
#include "tests/testing/full_stress.h"
#include "tests/testing/status_testing.h"
#include "tests/testing/temp_folder.h"

namespace pepeseg {
namespace {

constexpr int kStepKiB = 256;
constexpr int kEnoughKiB = 64 << 10;

// A tmpfs below a folder, visible to this thread and to processes that it starts.
class SmallDisk {
 public:
  explicit SmallDisk(int kib) : path_(folder_ / "disk") {
    std::filesystem::create_directory(path_);
    EXPECT_EQ(mount("tmpfs", path_.c_str(), "tmpfs", 0, Size(kib).c_str()), 0);
  }
  ~SmallDisk() { umount2(path_.c_str(), MNT_DETACH); }
  SmallDisk(const SmallDisk&) = delete;
  SmallDisk& operator=(const SmallDisk&) = delete;

  void Grow(int kib) const {
    EXPECT_EQ(mount("tmpfs", path_.c_str(), "tmpfs", MS_REMOUNT, Size(kib).c_str()), 0);
  }
  const std::filesystem::path& path() const { return path_; }

 private:
  static std::string Size(int kib) { return absl::StrCat("size=", kib, "k"); }
  const testing::TempFolder folder_;
  const std::filesystem::path path_;
};

bool ReportsSpace(const absl::Status& status) {
  return absl::IsResourceExhausted(status) || absl::StrContains(status.message(), "disk is full") ||
         absl::StrContains(status.message(), "No space left");
}

// Returns the first error of a life on a disk of that size; OK: there was none.
absl::Status LiveOn(int kib) {
  const SmallDisk disk(kib);
  const std::filesystem::path data = disk.path() / "data";
  const testing::PepesegdOptions options{{}, {}, PEPESEG_MODEL_WORKER, "", /*may_end=*/true};
  LifeOfAScene life("first");
  life.LetTrainingFail();
  absl::Status met = absl::ResourceExhaustedError("did not start");
  {
    testing::PepesegdProcess server(data, options);
    if (server.alive()) {
      met = life.Run(server.channel());
      EXPECT_TRUE(met.ok() || ReportsSpace(met)) << kib << " KiB: " << met << server.Log();
      EXPECT_TRUE(server.alive());
      disk.Grow(kEnoughKiB);
      absl::Status again;
      // A training in progress may report its failure now, or its end, which is written at the next
      // try.
      EXPECT_TRUE(testing::Eventually([&] {
        again = life.Run(server.channel());
        return !ReportsSpace(again);
      }));
      EXPECT_OK(again) << kib << " KiB, then enough: " << server.Log();
    }
    disk.Grow(kEnoughKiB);
    server.Terminate();
  }
  testing::PepesegdProcess server(data, options);
  EXPECT_OK(life.Check(server.channel())) << kib << " KiB: " << server.Log();
  EXPECT_OK(life.Run(server.channel())) << kib << " KiB: " << server.Log();
  server.Terminate();
  for (const std::string& what : FindUnclean(data)) ADD_FAILURE() << kib << " KiB: " << what;
  return met;
}

TEST(SmallDisk, ReportsThatItIsFullAndRecoversWhenThereIsSpace) {
  if (geteuid() != 0 || unshare(CLONE_NEWNS) != 0) GTEST_SKIP() << "needs root, to mount a disk";
  ASSERT_EQ(mount(nullptr, "/", nullptr, MS_REC | MS_PRIVATE, nullptr), 0);
  std::map<absl::StatusCode, int> met;
  const int step = testing::FullStress() ? kStepKiB : 8 * kStepKiB;
  int kib = kStepKiB;
  for (; kib < kEnoughKiB; kib += step) {
    const absl::Status status = LiveOn(kib);
    ++met[status.code()];
    if (status.ok()) break;
  }
  std::cout << "enough: " << kib << " KiB";
  for (const auto& [code, count] : met) {
    std::cout << ", " << absl::StatusCodeToString(code) << " " << count;
  }
  std::cout << "\n";
  EXPECT_EQ(met[absl::StatusCode::kOk], 1);
  EXPECT_GE(met[absl::StatusCode::kResourceExhausted], 1);
}

}  // namespace
}  // namespace pepeseg
