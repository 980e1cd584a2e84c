// Photographs: tests/core/dataset/heic_test.cc says what they show.
#include "core/train/prepare_files.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <memory>
#include <string>
#include <vector>

#include "core/base/file_io.h"
#include "core/base/status_macros.h"
#include "core/formats/exif.h"
#include "core/formats/images.h"
#include "tests/testing/status_testing.h"
#include "tests/testing/temp_folder.h"

namespace pepeseg {
namespace {

namespace fs = std::filesystem;

constexpr char kFlat[] = PEPESEG_TEST_DATA "/images/gradient.heic";
constexpr char kTurned[] = PEPESEG_TEST_DATA "/images/gradient_turned.heic";

std::string Read(const fs::path& path) {
  return ReadFile(path, path.string(), 1 << 20).value_or("");
}

Image Decode(const std::string& bytes) {
  const std::span span(reinterpret_cast<const uint8_t*>(bytes.data()), bytes.size());
  const auto image = DecodePhoto(span, "converted");
  EXPECT_OK(image);
  return image.value_or(Image());
}

// Keeps the steps that are reported, and cancels when `cancelled` is set.
struct HeicObserver final : TrainingObserver {
  absl::Status Step(const StepReport& report) override {
    steps.push_back(report);
    return absl::OkStatus();
  }
  bool IsCancelled() const override { return cancelled; }
  void SetPolling(bool value) override { polling = value; }

  std::vector<StepReport> steps;
  bool cancelled = false, polling = false;
};

struct ConvertHeicPhotographsTest : ::testing::Test {
  // As run number `run` of a training does it; `converted` are its files afterwards.
  absl::Status Convert(int run) {
    TrainingFolders folders;
    folders.run = Run(run);
    while (--run > 0) folders.earlier.push_back(Run(run));
    RETURN_IF_ERROR(stages.Start(Stage::kPrepare));
    converted = files;
    return ConvertHeicPhotographs(folders, stages, converted);
  }
  fs::path Run(int run) const { return folder / ("run-" + std::to_string(run)); }
  fs::path Write(const std::string& name, const std::string& bytes) const {
    std::ofstream(folder / name, std::ios::binary) << bytes;
    return folder / name;
  }

  const testing::TempFolder folder;
  HeicObserver observer;
  StageLog stages{observer};
  std::vector<DatasetFile> files = {{FileKind::kImage, "images/flat.heic", kFlat},
                                    {FileKind::kImage, "images/named_as.jpg", kTurned},
                                    {FileKind::kImage, "images/c.jpg", Write("c", "no HEIC")},
                                    {FileKind::kMask, "masks/flat.heic", kFlat}};
  std::vector<DatasetFile> converted;
};

TEST_F(ConvertHeicPhotographsTest, ReplacesOnlyHeicPhotographsByJpegs) {
  ASSERT_OK(Convert(1));
  ASSERT_EQ(converted.size(), files.size());
  for (size_t i = 0; i < files.size(); ++i) {
    EXPECT_EQ(converted[i].name, files[i].name);
    EXPECT_EQ(converted[i].path == files[i].path, i >= 2) << files[i].name;
  }
  const Image flat = Decode(Read(converted[0].path));
  EXPECT_EQ(flat.width, 96);
  EXPECT_EQ(flat.height, 64);
  const std::string turned = Read(converted[1].path);
  EXPECT_EQ(Decode(turned).height, 96) << "its pixels are upright";
  const std::span span(reinterpret_cast<const uint8_t*>(turned.data()), turned.size());
  EXPECT_EQ(ReadExifOrientation(span), 1) << "nobody turns them twice";
  EXPECT_EQ(ReadExifCamera(span).model, "Phone 1");
}

TEST_F(ConvertHeicPhotographsTest, ReportsItsSteps) {
  ASSERT_OK(Convert(1));
  bool reported = false;
  for (const StepReport& step : observer.steps) {
    reported |= step.num_steps == 2 && step.activity == "converting";
  }
  EXPECT_TRUE(reported);
}

TEST_F(ConvertHeicPhotographsTest, ReusesWhatAnEarlierRunConverted) {
  ASSERT_OK(Convert(1));
  const std::vector<DatasetFile> first = converted;
  ASSERT_OK(Convert(3));
  EXPECT_EQ(converted[0].path, first[0].path);
  EXPECT_EQ(converted[1].path, first[1].path);
}

TEST_F(ConvertHeicPhotographsTest, ConvertsAgainWhatAnEarlierRunDamaged) {
  ASSERT_OK(Convert(1));
  const std::vector<DatasetFile> first = converted;
  std::string bytes = Read(first[1].path);
  bytes[bytes.size() / 2] = static_cast<char>(bytes[bytes.size() / 2] ^ 1);
  std::ofstream(first[1].path, std::ios::binary) << bytes;
  ASSERT_OK(Convert(2));
  EXPECT_NE(converted[0].path, first[0].path);
  EXPECT_NE(converted[1].path, first[1].path);
  EXPECT_EQ(Decode(Read(converted[1].path)).height, 96);
}

TEST_F(ConvertHeicPhotographsTest, NamesAPhotographThatDoesNotDecode) {
  const std::string turned = Read(kTurned);
  files[1].path = Write("cut", turned.substr(0, turned.size() / 2));
  EXPECT_STATUS(Convert(1), absl::StatusCode::kInvalidArgument, "images/named_as.jpg: ");
}

TEST_F(ConvertHeicPhotographsTest, EndsWhenTheTrainingIsCancelled) {
  ASSERT_OK(stages.Start(Stage::kPrepare));
  observer.cancelled = true;
  EXPECT_EQ(ConvertHeicPhotographs({.run = Run(1)}, stages, files).code(),
            absl::StatusCode::kCancelled);
  EXPECT_FALSE(observer.polling) << "a signal ends the process at once again";
}

TEST_F(ConvertHeicPhotographsTest, DoesNothingWithoutHeicPhotographs) {
  files.erase(files.begin(), files.begin() + 2);
  ASSERT_OK(Convert(1));
  EXPECT_EQ(converted[0].path, files[0].path);
  EXPECT_FALSE(fs::exists(Run(1)));
}

}  // namespace
}  // namespace pepeseg
