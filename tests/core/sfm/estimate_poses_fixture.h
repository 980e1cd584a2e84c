#pragma once

#include <filesystem>
#include <fstream>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "core/formats/images.h"
#include "core/sfm/estimate_poses.h"
#include "tests/testing/status_testing.h"
#include "tests/testing/temp_folder.h"

namespace pepeseg {

// Runs the real COLMAP on synthetic photographs.
class EstimatePosesTest : public ::testing::Test {
 protected:
  EstimatePosesTest() {
    places_ = {"colmap", folder_ / "work", folder_ / "result", folder_ / "log", 2};
  }

  void Add(const Image& photo) {
    const std::string name = absl::StrCat("images/", files_.size(), ".jpg");
    const std::filesystem::path path = folder_ / absl::StrCat(files_.size());
    std::ofstream(path, std::ios::binary) << EncodeJpeg(photo, 95).value();
    files_.push_back({FileKind::kImage, name, path});
  }
  absl::StatusOr<EstimatedPoses> Estimate(const SfmOptions& options = {}) {
    const auto photographs = ReadSfmPhotographs(files_);
    EXPECT_OK(photographs);
    const auto warn = [&](absl::string_view message) { warnings_.emplace_back(message); };
    const auto progress = [&](const StepReport& report) {
      if (activities_.empty() || activities_.back() != report.activity) {
        activities_.emplace_back(report.activity);
        last_step_ = 0;
      }
      EXPECT_GE(report.step, last_step_) << report.activity;
      EXPECT_LE(report.step, report.num_steps) << report.activity;
      EXPECT_GE(report.share, last_share_) << report.activity;
      last_step_ = report.step;
      last_share_ = report.share;
      if (report.step == 1 && at_step_one_) at_step_one_();
      return cancel_at_ >= 0 && report.step >= cancel_at_ ? absl::CancelledError("enough")
                                                          : absl::OkStatus();
    };
    return EstimatePoses(*photographs, places_, options, {*backend_, progress, warn});
  }

  testing::TempFolder folder_;
  std::unique_ptr<Backend> backend_ = MakeCpuBackend(2);
  std::vector<std::string> warnings_;
  SfmPlaces places_;
  std::vector<DatasetFile> files_;
  std::vector<std::string> activities_;  // in the order of the reports
  int64_t last_step_ = 0;                // of the last activity
  double last_share_ = 0;
  int64_t cancel_at_ = -1;
  std::function<void()> at_step_one_;
};

}  // namespace pepeseg
