#pragma once

#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "core/formats/images.h"
#include "tests/server/worker/worker_fixture.h"
#include "tests/testing/eventually.h"
#include "tests/testing/status_testing.h"
#include "tests/testing/test_video.h"
#include "tests/testing/textured_place.h"

namespace pepeseg {

// Runs the worker on photographs and videos without poses.
class WorkerSfmTest : public WorkerTest {
 protected:
  WorkerSfmTest() {
    spec_.files.clear();
    spec_.options.mutable_import()->set_image_scale(0.25);
  }

  std::string PathOf(const std::string& name) const { return (folder_.path() / name).string(); }
  // Returns a path that programs of the job may write.
  std::string PathInJob(const std::string& name) const { return (job_.work() / name).string(); }

  void AddPhoto(const Image& photo) {
    const std::string path = PathOf(absl::StrCat("photo", spec_.files.size()));
    std::ofstream(path, std::ios::binary) << EncodeJpeg(photo, 95).value();
    const std::string name = absl::StrCat("images/", spec_.files.size(), ".jpg");
    spec_.files.push_back({name, v1::FILE_KIND_IMAGE, path, ""});
  }
  void AddPlace(int num_views, uint32_t seed) {
    for (const View& view : testing::PhotographPlace(testing::PlaceArc(num_views), seed)) {
      AddPhoto(view.photo);
    }
  }
  void AddVideo(const std::vector<Image>& frames) {
    testing::WriteVideo(PathOf("walk.avi"), frames);
    spec_.files.push_back({"videos/walk.avi", v1::FILE_KIND_VIDEO, PathOf("walk.avi"), ""});
  }
  // Uses a program as COLMAP that never ends. It writes its process id to "pid".
  void UseEndlessColmap() {
    spec_.worker.colmap = PathOf("endless");
    std::ofstream(spec_.worker.colmap)
        << "#!/bin/sh\nif [ $1 = help ]; then echo 'COLMAP 9.9 -- x'; exit; fi\n"
        << "echo 'Processed file [1/4]'; echo $$ > " << PathInJob("pid.new") << "; mv "
        << PathInJob("pid.new") << " " << PathInJob("pid") << "; exec sleep 100\n";
    std::filesystem::permissions(spec_.worker.colmap, std::filesystem::perms::owner_all);
  }
  pid_t WaitForColmap() {
    EXPECT_TRUE(testing::Eventually([&] { return std::filesystem::exists(PathInJob("pid")); }));
    pid_t pid = 0;
    std::ifstream(PathInJob("pid")) >> pid;
    return pid;
  }

  void ExpectRefused(const std::string& why) {
    ExpectExit(Run(), WorkerExit::kFailed);
    ASSERT_OK_AND_ASSIGN(const auto result, job_.ReadResult(spec_.fence));
    EXPECT_EQ(result.status.code(), absl::StatusCode::kFailedPrecondition) << result.status;
    EXPECT_THAT(std::string(result.status.message()), ::testing::HasSubstr(why));
  }
};

}  // namespace pepeseg
