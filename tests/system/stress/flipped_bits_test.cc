// One flipped bit in each kind of file that server and worker store: 1,000 positions of each with
// PEPESEG_STRESS=full, sixty in `make test`. A reader returns an error, or what was written.
#include <gtest/gtest.h>

#include <fstream>
#include <functional>
#include <random>
#include <set>

#include "absl/strings/str_cat.h"
#include "core/base/file_io.h"
#include "core/model_files/checkpoint.h"
#include "core/model_files/model_file.h"
#include "server/worker_protocol/event_log.h"
#include "server/worker_protocol/job_folder.h"
#include "tests/testing/full_stress.h"
#include "tests/testing/status_testing.h"
#include "tests/testing/temp_folder.h"

namespace pepeseg {
namespace {

namespace fs = std::filesystem;

int NumFlips() { return testing::FullStress() ? 1000 : 60; }

// What a reader returned for a file: an error, or its whole content as a text.
using Read = std::function<absl::StatusOr<std::string>()>;

class FlippedBitsTest : public ::testing::Test {
 protected:
  // Flips bits, and expects `read` to return DATA_LOSS, or the same as without a flip.
  void FlipEach(const fs::path& path, const Read& read) {
    const auto good = ReadFile(path, path.string(), int64_t{1} << 30);
    ASSERT_OK(good);
    const auto whole = read();
    ASSERT_OK(whole);
    std::mt19937_64 random(11);
    for (int i = 0; i < NumFlips(); ++i) {
      std::string bytes = *good;
      const size_t bit = random() % (8 * bytes.size());
      bytes[bit / 8] = static_cast<char>(bytes[bit / 8] ^ (1 << (bit % 8)));
      std::ofstream(path, std::ios::binary | std::ios::trunc) << bytes;
      const auto answer = read();
      if (answer.ok()) {
        EXPECT_EQ(*answer, *whole) << path << ": bit " << bit;
      } else {
        EXPECT_EQ(answer.status().code(), absl::StatusCode::kDataLoss)
            << path << ": bit " << bit << ": " << answer.status();
      }
    }
    std::ofstream(path, std::ios::binary | std::ios::trunc) << *good;
  }

  testing::TempFolder folder_;
};

Model MakeModel() {
  Model model;
  model.gaussians = Gaussians::Zero(40, 1);
  for (int64_t i = 0; i < 40; ++i) {
    model.gaussians.Plane(kMeanPlane)[i] = static_cast<float>(i);
    model.gaussians.Plane(kRotationPlane)[i] = 1;
  }
  model.field.features.assign(size_t{40} * 32, 0.25f);
  for (int i = 0; i < 1000; ++i) {
    model.field.scale_quantiles.push_back(0.001f * static_cast<float>(i + 1));
  }
  ModelView view;
  view.name = "a.jpg";
  view.camera = {96, 64, 60, 60, 48, 32};
  model.views = {view};
  model.metrics["psnr"] = 30;
  return model;
}

TEST_F(FlippedBitsTest, AreDetectedInAModel) {
  const fs::path model = folder_ / "model";
  fs::create_directories(model);
  ASSERT_OK(WriteModel(model, MakeModel()));
  const Read read = [&]() -> absl::StatusOr<std::string> {
    const auto found = ReadModel(model);
    if (!found.ok()) return found.status();
    // Writing it again makes equal content comparable byte by byte.
    const testing::TempFolder copy;
    EXPECT_OK(WriteModel(copy.path(), *found));
    std::string all;
    for (const auto& entry : fs::directory_iterator(copy.path())) {
      all += ReadFile(entry.path(), "", int64_t{1} << 30).value_or("");
    }
    return all;
  };
  std::set<fs::path> files;
  for (const auto& entry : fs::directory_iterator(model)) files.insert(entry.path());
  EXPECT_GE(files.size(), 3u);
  for (const fs::path& file : files) FlipEach(file, read);
}

TEST_F(FlippedBitsTest, AreDetectedInACheckpoint) {
  const fs::path path = folder_ / "reconstruct-000000100.ckpt";
  const std::vector<CheckpointSection> sections = {{"gaussians", 1, "some bytes"},
                                                   {"moments", 2, "and others"}};
  ASSERT_OK(WriteCheckpoint(path, {"reconstruct", "abc", 100}, sections));
  FlipEach(path, [&]() -> absl::StatusOr<std::string> {
    const auto found = ReadCheckpoint(path);
    if (!found.ok()) return found.status();
    std::string all = absl::StrCat(found->header.stage, found->header.identity, found->header.step);
    for (const CheckpointSection& section : found->sections) {
      absl::StrAppend(&all, section.name, section.version, std::string(section.bytes));
    }
    return all;
  });
}

TEST_F(FlippedBitsTest, AreDetectedInASelection) {
  GaussianSet set;
  for (int i = 0; i < 1000; ++i) set.member.push_back(i % 3 == 0 ? 1 : 0);
  const fs::path path = folder_ / "1";
  ASSERT_OK(WriteSelectionFile(path, set));
  FlipEach(path, [&]() -> absl::StatusOr<std::string> {
    const auto found = ReadSelectionFile(path, "scenes/s/selections/1");
    if (!found.ok()) return found.status();
    std::string all;
    for (const uint8_t member : found->member) all += member != 0 ? '1' : '0';
    return all;
  });
}

// The events before the flip are returned, and no others.
TEST_F(FlippedBitsTest, AreDetectedInAnEventLog) {
  const fs::path path = folder_ / "events.log";
  std::vector<std::string> written;
  {
    auto log = EventLogWriter::Open(path);
    ASSERT_OK(log);
    for (int i = 0; i < 30; ++i) {
      v1::JobEvent event;
      event.mutable_warning()->set_message(absl::StrCat("warning ", i));
      ASSERT_OK((*log)->Append(event));
    }
  }
  const auto read = [&] {
    EventLogReader reader(path);
    std::vector<std::string> reported;
    while (true) {
      const auto events = reader.Read();
      if (!events.ok() || events->empty()) return reported;
      for (const v1::JobEvent& event : *events) reported.push_back(event.SerializeAsString());
    }
  };
  const std::vector<std::string> whole = read();
  ASSERT_EQ(whole.size(), 30u);
  FlipEach(path, [&]() -> absl::StatusOr<std::string> {
    const std::vector<std::string> reported = read();
    EXPECT_LE(reported.size(), whole.size());
    for (size_t i = 0; i < reported.size(); ++i) EXPECT_EQ(reported[i], whole[i]);
    return std::string();
  });
}

}  // namespace
}  // namespace pepeseg
