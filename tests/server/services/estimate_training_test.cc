#include "server/services/estimate_training.h"

#include <gmock/gmock.h>
#include <google/protobuf/util/time_util.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>

#include "absl/strings/str_cat.h"
#include "core/base/digest.h"
#include "core/priors/sam/sam_segmenter.h"
#include "server/store/layout.h"
#include "tests/server/service_test.h"
#include "tests/server/store/scene_of.h"
#include "tests/server/store/test_database.h"
#include "tests/testing/fake_sam.h"
#include "tests/testing/png_bytes.h"
#include "tests/testing/status_testing.h"

namespace pepeseg {
namespace {

using ::google::protobuf::util::TimeUtil;
using ::testing::ElementsAre;

// Black pictures suffice, since nothing is decoded.
std::vector<TestFile> Photos() {
  std::vector<TestFile> files;
  files.reserve(5);
  for (int i = 0; i < 4; ++i) {
    files.push_back({absl::StrCat("images/", i, ".png"), testing::BlackPng(400, 300 + 20 * i, 8)});
  }
  files.push_back(
      {"sparse/0/points3D.txt", "# a comment\n1 0 0 0\n2 0 0 0\n\n3 0 0 0\n", v1::FILE_KIND_POSES});
  return files;
}

std::vector<v1::JobStage> Stages(const v1::EstimateTrainingResponse& estimate) {
  std::vector<v1::JobStage> stages;
  for (const auto& stage : estimate.stages()) stages.push_back(stage.stage());
  return stages;
}

struct EstimateTrainingTest : EmptyScene {
  EstimateTrainingTest() : EmptyScene(PEPESEG_FAKE_WORKER) {}

  Reply<v1::EstimateTrainingResponse> Estimate(const std::string& dataset,
                                               const v1::TrainingOptions& options = {}) const {
    v1::EstimateTrainingRequest request;
    request.set_scene("scenes/shelf");
    request.set_dataset(dataset);
    *request.mutable_options() = options;
    return Call(&JobStub::EstimateTraining, request);
  }
  grpc::Status Train(const std::string& dataset, const v1::TrainingOptions& options,
                     bool validate_only) {
    v1::TrainSceneRequest request;
    request.set_scene("scenes/shelf");
    request.set_dataset(dataset);
    *request.mutable_options() = options;
    request.set_validate_only(validate_only);
    return Call(&JobStub::TrainScene, request);
  }
  // Restarts the server with SAM and two threads.
  void InstallSam() {
    testing::MakeFakeSam(running.folder / "sam");
    running.options.workers.sam = running.folder / "sam";
    running.options.num_threads = 2;
    running.Restart();
  }
};

TEST_F(EstimateTrainingTest, ReportsWhatTheHeadersAndOptionsSay) {
  const std::string dataset = running.UploadAndSeal("shelf", Photos());
  v1::TrainingOptions options;
  options.mutable_reconstruct()->set_max_gaussians(10'000);
  ASSERT_OK_AND_ASSIGN(const auto estimate, Estimate(dataset, options));
  EXPECT_EQ(estimate.num_views(), 4);
  EXPECT_EQ(estimate.max_pixels(), 400 * 360);
  EXPECT_EQ(estimate.num_points(), 3);
  EXPECT_EQ(estimate.num_mask_files(), 0);
  EXPECT_EQ(estimate.device().find("cpu (1 thread, "), 0u);
  ASSERT_THAT(Stages(estimate),
              ElementsAre(v1::JOB_STAGE_PREPARE, v1::JOB_STAGE_RECONSTRUCT, v1::JOB_STAGE_EVALUATE,
                          v1::JOB_STAGE_PRIORS, v1::JOB_STAGE_FEATURES, v1::JOB_STAGE_INDEX));
  // At least parameters and two moments, of 59 floats each.
  EXPECT_GT(estimate.stages(1).device_bytes(), 10'000 * 3 * 59 * 4);
  int64_t most = 0;
  for (const auto& stage : estimate.stages()) {
    most = std::max(most, stage.device_bytes() + stage.host_bytes());
  }
  EXPECT_EQ(estimate.need_bytes(), most);
  EXPECT_GT(estimate.have_bytes(), estimate.need_bytes());
  double sum = 0;
  for (const auto& stage : estimate.stages()) {
    EXPECT_TRUE(stage.has_duration());
    sum += TimeUtil::DurationToMilliseconds(stage.duration());
  }
  EXPECT_NEAR(TimeUtil::DurationToMilliseconds(estimate.duration()), sum, 10);
}

TEST_F(EstimateTrainingTest, ExpectsMoreTimeForMoreStepsAndPixels) {
  const std::string dataset = running.UploadAndSeal("shelf", Photos());
  const auto seconds = [&](const v1::TrainingOptions& options) {
    return TimeUtil::DurationToMilliseconds(Estimate(dataset, options)->duration()) * 1e-3;
  };
  v1::TrainingOptions options;
  options.mutable_reconstruct()->set_num_steps(10'000);
  const double all = seconds(options);
  options.mutable_import()->set_image_scale(0.5);
  EXPECT_LT(seconds(options), 0.8 * all);
  options.mutable_reconstruct()->set_num_steps(20'000);
  EXPECT_GT(seconds(options), 1.2 * seconds([&] {
                                v1::TrainingOptions half = options;
                                half.mutable_reconstruct()->set_num_steps(10'000);
                                return half;
                              }()));
}

TEST_F(EstimateTrainingTest, EstimatesLessForSmallerPhotographsAndFewerGaussians) {
  const std::string dataset = running.UploadAndSeal("shelf", Photos());
  v1::TrainingOptions options;
  const int64_t all = Estimate(dataset, options)->need_bytes();
  options.mutable_import()->set_image_scale(0.5);
  ASSERT_OK_AND_ASSIGN(const auto small, Estimate(dataset, options));
  EXPECT_EQ(small.max_pixels(), 400 * 360 / 4);
  EXPECT_LT(small.need_bytes(), all);
  options.mutable_reconstruct()->set_max_gaussians(1000);
  ASSERT_OK_AND_ASSIGN(const auto sparse, Estimate(dataset, options));
  EXPECT_LT(sparse.need_bytes(), small.need_bytes());
}

TEST_F(EstimateTrainingTest, CountsTheTimeAndMemoryOfSam) {
  const std::string dataset = running.UploadAndSeal("shelf", Photos());
  InstallSam();
  ASSERT_OK_AND_ASSIGN(const auto estimate, Estimate(dataset));
  const auto& priors = estimate.stages(3);
  ASSERT_EQ(priors.stage(), v1::JOB_STAGE_PRIORS);
  EXPECT_GT(priors.host_bytes(), int64_t{523} << 20);
  EXPECT_GE(estimate.need_bytes(), priors.host_bytes());
  EXPECT_EQ(priors.duration().seconds(), static_cast<int64_t>(4 * kSamCoreSeconds / 2));
  v1::TrainingOptions options;
  options.mutable_priors()->set_masks(v1::PRIOR_MAKER_EMBEDDED);
  EXPECT_LT(Estimate(dataset, options)->stages(3).duration().seconds(),
            priors.duration().seconds());
}

// SAM and COLMAP run at the same time, in two processes.
TEST_F(EstimateTrainingTest, AddsTheMemoryOfSamToThatOfColmap) {
  std::vector<TestFile> files = Photos();
  files.pop_back();
  const std::string dataset = running.UploadAndSeal("shelf", files);
  ASSERT_OK_AND_ASSIGN(const auto without_sam, Estimate(dataset));
  ASSERT_EQ(without_sam.stages(1).stage(), v1::JOB_STAGE_SFM);
  InstallSam();
  ASSERT_OK_AND_ASSIGN(const auto with_sam, Estimate(dataset));
  EXPECT_EQ(with_sam.stages(1).host_bytes(), without_sam.stages(1).host_bytes() + SamHostBytes(2));
}

TEST_F(EstimateTrainingTest, AddsTheFeaturesStageForMasks) {
  std::vector<TestFile> files = Photos();
  files.push_back({"masks/0.png", testing::BlackPng(400, 300, 8), v1::FILE_KIND_MASK});
  ASSERT_OK_AND_ASSIGN(const auto estimate, Estimate(running.UploadAndSeal("shelf", files)));
  EXPECT_EQ(estimate.num_mask_files(), 1);
  ASSERT_THAT(Stages(estimate),
              ElementsAre(v1::JOB_STAGE_PREPARE, v1::JOB_STAGE_RECONSTRUCT, v1::JOB_STAGE_EVALUATE,
                          v1::JOB_STAGE_FEATURES, v1::JOB_STAGE_INDEX));
  EXPECT_GT(estimate.stages(3).device_bytes(), 0);
}

TEST_F(EstimateTrainingTest, CountsNoMasksThatSayWhatToIgnore) {
  std::vector<TestFile> files = Photos();
  files.back() = {"transforms.json",
                  R"({"frames": [{"file_path": "images/0.png", "mask_path": "./Keep/0.png"}]})",
                  v1::FILE_KIND_POSES};
  files.push_back({"keep/0.png", testing::BlackPng(400, 300, 8), v1::FILE_KIND_MASK});
  ASSERT_OK_AND_ASSIGN(const auto named, Estimate(running.UploadAndSeal("shelf", files)));
  EXPECT_EQ(named.num_mask_files(), 0);
  files.push_back({"masks/0.png", testing::BlackPng(400, 300, 8), v1::FILE_KIND_MASK});
  ASSERT_OK_AND_ASSIGN(const auto both, Estimate(running.UploadAndSeal("shelf", files)));
  EXPECT_EQ(both.num_mask_files(), 1);
  // SAM makes the masks where there are none.
  InstallSam();
  ASSERT_OK_AND_ASSIGN(const auto made, Estimate("scenes/shelf/datasets/1"));
  ASSERT_EQ(made.stages(3).stage(), v1::JOB_STAGE_PRIORS);
  EXPECT_GT(made.stages(3).host_bytes(), SamHostBytes(2));
}

TEST_F(EstimateTrainingTest, RefusesTrainingsThatDoNotFitBeforeTheyAreQueued) {
  const std::string dataset = running.UploadAndSeal("shelf", Photos());
  v1::TrainingOptions options;
  options.mutable_reconstruct()->set_max_gaussians(100'000'000);
  (*options.mutable_advanced())["reconstruct.pixels_per_gaussian"] =
      "0";  // else the budget is the limit
  ASSERT_OK_AND_ASSIGN(const auto estimate, Estimate(dataset, options));
  ASSERT_GT(estimate.need_bytes(), estimate.have_bytes()) << "this machine takes anything";
  for (const bool validate_only : {true, false}) {
    const grpc::Status refused = Train(dataset, options, validate_only);
    EXPECT_ERROR(refused, grpc::RESOURCE_EXHAUSTED);
    const v1::Error detail = DetailOf(refused);
    EXPECT_EQ(detail.reason(), "DOES_NOT_FIT");
    EXPECT_EQ(detail.value(), absl::StrCat(estimate.need_bytes(), " bytes"));
    EXPECT_EQ(detail.limit(), absl::StrCat(estimate.have_bytes(), " bytes"));
  }
  EXPECT_EQ(Call(&JobStub::ListJobs, {})->jobs_size(), 0);
}

TEST_F(EstimateTrainingTest, NamesAFileThatIsNotAPhotographAndLeavesItToTheJob) {
  const std::string dataset = running.UploadAndSeal("shelf", {{"fine", "bytes"}});
  EXPECT_ERROR(Estimate(dataset), grpc::INVALID_ARGUMENT, {.message = "fine"});
  EXPECT_OK(Train(dataset, {}, /*validate_only=*/true));
}

// Photographs with so much metadata that their size is not in the first MiB.
std::vector<TestFile> LargePhotos() {
  std::vector<TestFile> files = Photos();
  std::string jpeg = "\xFF\xD8";
  for (int i = 0; i < 20; ++i) jpeg += "\xFF\xE1\xFF\xFF" + std::string(0xFFFD, 'x');
  jpeg += std::string("\xFF\xC0\x00\x0B\x08\x03\xE8\x07\xD0\x01\x01\x11\x00", 13);
  files.push_back({"images/large.jpg", jpeg + std::string(1 << 20, 'x')});
  return files;
}

// Replaces the bytes of each stored file by zeros, so that no header can be read again.
void BlankBlobs(const RunningServer& running) {
  int num_blobs = 0;
  for (const auto& entry :
       std::filesystem::recursive_directory_iterator(BlobFolder(running.options.data))) {
    if (!entry.is_regular_file()) continue;
    const auto size = entry.file_size();
    std::filesystem::permissions(entry.path(), std::filesystem::perms::owner_write,
                                 std::filesystem::perm_options::add);
    std::filesystem::resize_file(entry.path(), 0);
    std::filesystem::resize_file(entry.path(), size);
    ++num_blobs;
  }
  ASSERT_GT(num_blobs, 0);
}

TEST_F(EstimateTrainingTest, UsesHeadersReadWhenTheFilesWereStored) {
  const std::string dataset = running.UploadAndSeal("shelf", LargePhotos());
  BlankBlobs(running);
  ASSERT_OK_AND_ASSIGN(const auto estimate, Estimate(dataset));
  EXPECT_EQ(estimate.num_views(), 5);
  EXPECT_EQ(estimate.max_pixels(), 2000 * 1000);
  EXPECT_EQ(estimate.num_points(), 3);
}

TEST_F(EstimateTrainingTest, ReadsMissingHeadersOnce) {
  const std::string dataset = running.UploadAndSeal("shelf", LargePhotos());
  // Another upload of the same files, of which nothing is written.
  const v1::Upload again = running.CreateUpload("shelf", LargePhotos());
  ASSERT_OK_AND_ASSIGN(const v1::Dataset sealed,
                       Call(&DatasetStub::SealUpload, Named{again.name()}));
  for (const bool blanked : {false, true}) {
    if (blanked) BlankBlobs(running);
    ASSERT_OK_AND_ASSIGN(const auto estimate, Estimate(sealed.name()));
    EXPECT_EQ(estimate.max_pixels(), 2000 * 1000);
    EXPECT_EQ(estimate.num_points(), 3);
  }
}

TEST_F(EstimateTrainingTest, CountsColmapPointsByTheStartOfTheFile) {
  std::string lines;
  for (int i = 0; i < 20'000; ++i) absl::StrAppend(&lines, "7 1.0 2.0 3.0 100 100 100 0.5 1 2\n");
  struct Case {
    std::string text;
    int64_t least, most;
  };
  const std::vector<Case> cases = {
      {"# Number of points: 12345, mean track length: 3\n" + lines, 12'345, 12'345},
      {"# Number of points: 99999999999\n" + lines, 20'000, 45'000},
      {"# a comment\n" + lines, 19'900, 20'100}};
  for (const Case& one : cases) {
    std::vector<TestFile> files = Photos();
    files.back().bytes = one.text;
    ASSERT_OK_AND_ASSIGN(const auto estimate, Estimate(running.UploadAndSeal("shelf", files)));
    EXPECT_GE(estimate.num_points(), one.least);
    EXPECT_LE(estimate.num_points(), one.most);
  }
}

// A cancelled call keeps the headers that it has read, so that the next call gets further.
TEST(MeasureDataset, StopsWhenTheCallerIsGone) {
  const testing::TempFolder folder;
  const auto store = *Store::Open(testing::NewTestDatabase(folder.path()));
  const auto blobs = *BlobStore::Open(folder / "data");
  ASSERT_OK(store->scenes().CreateScene(NewScene("a")));
  std::vector<DatasetFileRecord> files;
  for (int i = 0; i < 3; ++i) {
    const std::string bytes = testing::BlackPng(40 + i, 30, 8);
    files.push_back({absl::StrCat(i, ".png"), v1::FILE_KIND_IMAGE,
                     static_cast<int64_t>(bytes.size()), Sha256Hex(bytes), true});
    const auto path = blobs->Path({kDefaultProject, files.back().sha256});
    std::filesystem::create_directories(path.parent_path());
    std::ofstream(path, std::ios::binary) << bytes;
  }
  ASSERT_OK(store->datasets().CreateDataset(SceneOf(*store, "a"), "", files));
  int num_asked = 0;
  const auto wanted = [&num_asked] {
    return ++num_asked > 2 ? absl::CancelledError("the client is gone") : absl::OkStatus();
  };
  EXPECT_TRUE(absl::IsCancelled(
      MeasureDataset(*store, *blobs, {SceneOf(*store, "a"), 1, {}}, wanted).status()));
  EXPECT_EQ(num_asked, 3);
  ASSERT_OK_AND_ASSIGN(files, store->files().ListDatasetFiles(SceneOf(*store, "a"), 1));
  EXPECT_EQ(files[0].width, 40);
  EXPECT_EQ(files[1].header, HeaderState::kRead);
  EXPECT_EQ(files[2].header, HeaderState::kUnread);
  ASSERT_OK_AND_ASSIGN(const DatasetSize size,
                       MeasureDataset(*store, *blobs, {SceneOf(*store, "a"), 1, {}},
                                      [] { return absl::OkStatus(); }));
  EXPECT_EQ(size.max_source_pixels, 42 * 30);
}

TEST_F(EstimateTrainingTest, RefusesWhatTrainSceneRefuses) {
  EXPECT_ERROR(Estimate("scenes/shelf/datasets/9"), grpc::NOT_FOUND);
  EXPECT_ERROR(Estimate("scenes/other/datasets/1"), grpc::INVALID_ARGUMENT);
  running.CreateUpload("shelf", {{"a", "bytes"}});
  EXPECT_ERROR(Estimate("scenes/shelf/datasets/1"), grpc::FAILED_PRECONDITION);
  v1::TrainingOptions options;
  options.mutable_reconstruct()->set_num_steps(0);
  EXPECT_ERROR(Estimate("scenes/shelf/datasets/1", options), grpc::INVALID_ARGUMENT);
}

}  // namespace
}  // namespace pepeseg
