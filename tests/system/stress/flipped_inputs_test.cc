// One flipped bit in the stored bytes of a file of each kind. A worker never trains on it. 66
// positions of each with PEPESEG_STRESS=full, three in `make test`.
#include <map>
#include <random>
#include <set>

#include "core/base/file_io.h"
#include "core/formats/gaussian_ply.h"
#include "server/store/layout.h"
#include "tests/server/pepesegd_process.h"
#include "tests/server/service_client.h"
#include "tests/server/worker/worker_fixture.h"
#include "tests/testing/full_stress.h"
#include "tests/testing/status_testing.h"

namespace pepeseg {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

int NumInputFlips() { return testing::FullStress() ? 66 : 3; }

std::string WithFlippedBit(std::string bytes, uint64_t random) {
  const size_t bit = random % (8 * bytes.size());
  bytes[bit / 8] = static_cast<char>(bytes[bit / 8] ^ (1 << (bit % 8)));
  return bytes;
}

std::string PointsPly() {
  return "ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty float y\n"
         "property float z\nend_header\n0 0 1\n0.5 0.5 1.5\n";
}

std::string GaussiansPly() {
  Gaussians gaussians = Gaussians::Zero(200, 0);
  for (int64_t i = 0; i < gaussians.count; ++i) {
    gaussians.Plane(kMeanPlane)[i] = 0.01f * static_cast<float>(i);
    gaussians.Plane(kMeanPlane + 2)[i] = 1;
    gaussians.Plane(kRotationPlane)[i] = 1;
    for (int k = 0; k < 3; ++k) gaussians.Plane(kLogScalePlane + k)[i] = -4;
  }
  return EncodeGaussianPly(gaussians);
}

// Runs the worker on copies of a capture's files, and on files of the kinds that it does not have.
class FlippedInputs : public WorkerTest {
 protected:
  FlippedInputs() {
    for (JobSpecFile& file : spec_.files) {
      Store(file, ReadFile(file.path, file.name, 1 << 30).value_or(""));
    }
    Add("points.ply", v1::FILE_KIND_POINTS, PointsPly());
    Add("gaussians.ply", v1::FILE_KIND_GAUSSIANS, GaussiansPly());
    Add("disparity/frame-000003.pfm", v1::FILE_KIND_DISPARITY,
        "Pf\n1 1\n-1.0\n" + std::string("\0\0\x80\x3f", 4));
    Add("videos/walk.avi", v1::FILE_KIND_VIDEO, std::string(5000, 'v'));
  }
  void Add(const std::string& name, v1::FileKind kind, const std::string& bytes) {
    spec_.files.push_back({name, kind, "", ""});
    Store(spec_.files.back(), bytes);
  }
  void Store(JobSpecFile& file, const std::string& bytes) {
    file.path = (folder_ / absl::StrCat("blob-", ++num_blobs_)).string();
    file.sha256 = Sha256Hex(bytes);
    EXPECT_OK(WriteFileAtomically(file.path, bytes));
  }
  void ExpectDataLoss(const JobSpecFile& file) {
    ExpectExit(Run(), WorkerExit::kFailed);
    const auto result = job_.ReadResult(1);
    ASSERT_OK(result);
    EXPECT_EQ(result->status.code(), absl::StatusCode::kDataLoss) << result->status;
    EXPECT_THAT(std::string(result->status.message()), HasSubstr(file.name + ": "));
    EXPECT_EQ(result->damaged, std::vector<std::string>{file.sha256});
    EXPECT_FALSE(fs::exists(job_.attempt(1)));
  }

 private:
  int num_blobs_ = 0;
};

TEST_F(FlippedInputs, OfEveryKindFailTheJobBeforeItDecodesAnything) {
  std::map<int, const JobSpecFile*> by_kind;
  for (const JobSpecFile& file : spec_.files) by_kind.emplace(file.kind, &file);
  std::set<int> all;
  for (int kind = v1::FileKind_MIN; kind <= v1::FileKind_MAX; ++kind) {
    if (v1::FileKind_IsValid(kind) && kind != v1::FILE_KIND_UNSPECIFIED) all.insert(kind);
  }
  std::mt19937_64 random(11);
  for (const auto& [kind, file] : by_kind) {
    all.erase(kind);
    const std::string good = ReadFile(file->path, file->name, 1 << 30).value_or("");
    ASSERT_EQ(Sha256Hex(good), file->sha256);
    for (int i = 0; i < NumInputFlips(); ++i) {
      SCOPED_TRACE(absl::StrCat(file->name, ", flip ", i));
      ASSERT_OK(WriteFileAtomically(file->path, WithFlippedBit(good, random())));
      ExpectDataLoss(*file);
    }
    ASSERT_OK(WriteFileAtomically(file->path, good));
  }
  EXPECT_TRUE(all.empty()) << "a kind without a flip: " << *all.begin();
}

v1::TrainingOptions FewSteps() {
  v1::TrainingOptions options;
  options.mutable_import()->set_image_scale(0.125);
  options.mutable_reconstruct()->set_num_steps(60);
  options.mutable_features()->set_num_steps(20);
  (*options.mutable_advanced())["features.num_pixels"] = "200";
  (*options.mutable_advanced())["features.steps_per_chunk"] = "20";
  return options;
}

// Runs the server program and the worker program together.
class FlippedUploads : public ::testing::Test {
 protected:
  v1::Job Train(const std::string& dataset) {
    const auto job = client_.Train("shelf", dataset, FewSteps());
    EXPECT_OK(job);
    const auto ended = client_.WaitForJob(job.ok() ? job->name() : "");
    EXPECT_OK(ended);
    return ended.value_or(v1::Job());
  }
  fs::path BlobOf(const testing::ClientFile& file) const {
    return BlobPath(data_, {"default", Sha256Hex(file.bytes)});
  }

  const testing::TempFolder folder_;
  const fs::path data_ = folder_ / "data";
  testing::PepesegdProcess server_{data_};
  testing::ServiceClient client_{server_.channel()};
};

TEST_F(FlippedUploads, GiveNoModelUntilTheSameFilesAreUploadedAgain) {
  const std::vector<testing::ClientFile> files =
      testing::ReadDataset(PEPESEG_TEST_DATA "/apc_shelf");
  ASSERT_OK(client_.CreateScene("shelf"));
  ASSERT_OK_AND_ASSIGN(const std::string dataset, client_.Upload("shelf", files));
  std::map<int, const testing::ClientFile*> by_kind;
  for (const testing::ClientFile& file : files) by_kind.emplace(file.kind, &file);
  std::mt19937_64 random(3);
  for (const auto& [kind, file] : by_kind) {
    ASSERT_OK(WriteFileAtomically(BlobOf(*file), WithFlippedBit(file->bytes, random())));
  }
  const v1::Job failed = Train(dataset);
  EXPECT_EQ(failed.state(), v1::JOB_STATE_FAILED);
  EXPECT_EQ(failed.error().code(), grpc::DATA_LOSS) << failed.error().message();
  EXPECT_THAT(failed.error().message(),
              HasSubstr(absl::StrCat("as are those of ", by_kind.size() - 1, " more files")));
  EXPECT_EQ(failed.error().message().find(data_.string()), std::string::npos);
  for (const auto& [kind, file] : by_kind) EXPECT_FALSE(fs::exists(BlobOf(*file))) << file->path;

  EXPECT_EQ(client_.Train("shelf", dataset, FewSteps()).status().code(),
            absl::StatusCode::kFailedPrecondition);
  ASSERT_OK_AND_ASSIGN(const v1::Upload again, client_.CreateUpload("shelf", files));
  EXPECT_EQ(static_cast<size_t>(again.missing_files_size()), by_kind.size());
  ASSERT_OK(client_.WriteFiles(again, files));
  ASSERT_OK(client_.SealUpload(again.name()));
  EXPECT_EQ(Train(dataset).state(), v1::JOB_STATE_SUCCEEDED) << "the dataset of before";
}

}  // namespace
}  // namespace pepeseg
