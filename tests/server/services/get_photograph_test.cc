#include <gtest/gtest.h>

#include <csignal>
#include <fstream>
#include <set>
#include <thread>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "core/base/digest.h"
#include "core/formats/decode_image.h"
#include "core/formats/encode_png.h"
#include "server/store/layout.h"
#include "server/store/rows.h"
#include "server/worker_protocol/photograph_task.h"
#include "tests/server/shelf_model.h"

namespace pepeseg {
namespace {

// Red to the left, blue to the right.
Image TwoColours(int width, int height) {
  Image image{width, height, 3, {}};
  for (int i = 0; i < width * height; ++i) {
    const bool left = i % width < width / 2;
    image.pixels.insert(image.pixels.end(),
                        {left ? uint8_t{250} : uint8_t{10}, 20, left ? uint8_t{10} : uint8_t{250}});
  }
  return image;
}

std::string Jpeg(const Image& image) {
  const auto jpeg = EncodeJpeg(image, 95);
  EXPECT_TRUE(jpeg.ok()) << jpeg.status();
  return jpeg.ok() ? *jpeg : "";
}

// Adds an EXIF segment with this orientation: one directory with one entry.
std::string Turned(std::string jpeg, char orientation) {
  using std::string_literals::operator""s;
  const std::string exif = "\xff\xe1\0\x22"s + "Exif\0\0"s + "MM\0\x2a\0\0\0\x08"s + "\0\x01"s +
                           "\x01\x12\0\x03\0\0\0\x01\0"s + orientation + std::string(6, '\0');
  return jpeg.insert(2, exif);
}

// The answer of a call.
struct SentPhotograph {
  grpc::Status status;
  v1::GetPhotographResponse::Header header;
  std::string bytes;

  Image Decoded() const {
    const std::span span(reinterpret_cast<const uint8_t*>(bytes.data()), bytes.size());
    const auto image = DecodePhoto(span, "answer");
    EXPECT_TRUE(image.ok()) << image.status();
    return image.ok() ? *image : Image();
  }
};

SentPhotograph Get(RunningServer& running, const v1::GetPhotographRequest& request) {
  grpc::ClientContext context;
  const auto stream = running.datasets->GetPhotograph(&context, request);
  v1::GetPhotographResponse part;
  SentPhotograph photograph;
  while (stream->Read(&part)) {
    if (part.has_header()) photograph.header = part.header();
    if (!part.has_chunk()) continue;
    EXPECT_LE(part.chunk().data().size(), size_t{1} << 20);
    EXPECT_EQ(part.chunk().crc32c(), Crc32c(part.chunk().data()));
    photograph.bytes += part.chunk().data();
  }
  photograph.status = stream->Finish();
  return photograph;
}

struct GetPhotographTest : ::testing::Test {
  explicit GetPhotographTest(const std::string& worker = PEPESEG_WORKER) : running(worker) {
    running.CreateScene("shelf");
    upright = Jpeg(TwoColours(60, 36));
    large = Jpeg(TwoColours(30, 20)) + std::string(2'500'000, 'x');
    request.set_parent(
        running.UploadAndSeal("shelf", {{"images/b.jpg", upright},
                                        {"images/cam0/turned.jpg", Turned(upright, 6)},
                                        {"images/large.jpg", large},
                                        {"images/text.jpg", "no image"},
                                        {"videos/walk.mp4", "a video", v1::FILE_KIND_VIDEO},
                                        {"masks/a.png", "a mask", v1::FILE_KIND_MASK}}));
  }
  SentPhotograph Get(const std::string& name) {
    request.set_photograph(name);
    return pepeseg::Get(running, request);
  }
  void ExpectRefused(const std::string& field, const std::string& words) {
    const SentPhotograph photograph = Get("b.jpg");
    EXPECT_EQ(photograph.status.error_code(), grpc::INVALID_ARGUMENT) << words;
    EXPECT_EQ(DetailOf(photograph.status).field(), field);
    EXPECT_TRUE(absl::StrContains(photograph.status.error_message(), words))
        << photograph.status.error_message();
  }
  std::filesystem::path BlobOf(const std::string& bytes) const {
    return BlobPath(running.options.data, {kDefaultProject, Sha256Hex(bytes)});
  }

  RunningServer running;
  std::string upright, large;
  v1::GetPhotographRequest request;
};

TEST_F(GetPhotographTest, ReturnsTheBytesThatWereUploaded) {
  request.set_original(true);
  for (const auto& [name, bytes] : {std::pair("b.jpg", upright), std::pair("large.jpg", large)}) {
    const SentPhotograph photograph = Get(name);
    ASSERT_TRUE(photograph.status.ok()) << photograph.status.error_message();
    EXPECT_EQ(photograph.header.content_type(), "image/jpeg");
    EXPECT_EQ(photograph.header.width(), name == std::string("b.jpg") ? 60 : 30);
    EXPECT_EQ(photograph.header.num_bytes(), static_cast<int64_t>(bytes.size()));
    EXPECT_TRUE(photograph.bytes == bytes) << name;
  }
}

TEST_F(GetPhotographTest, DecodesAndShrinks) {
  const SentPhotograph whole = Get("b.jpg");
  ASSERT_TRUE(whole.status.ok()) << whole.status.error_message();
  EXPECT_EQ(whole.header.content_type(), "image/jpeg");
  EXPECT_EQ(whole.header.num_bytes(), static_cast<int64_t>(whole.bytes.size()));
  EXPECT_EQ(whole.Decoded().width, 60);
  request.set_max_side(30);
  const SentPhotograph half = Get("b.jpg");
  ASSERT_TRUE(half.status.ok()) << half.status.error_message();
  EXPECT_EQ(half.header.width(), 30);
  EXPECT_EQ(half.header.height(), 18);
  const Image image = half.Decoded();
  ASSERT_EQ(image.width, 30);
  ASSERT_EQ(image.height, 18);
  EXPECT_GT(image.pixels[3 * (9 * 30 + 5)], 200) << "the left is red";
  EXPECT_LT(image.pixels[3 * (9 * 30 + 25)], 60) << "the right is blue";
}

TEST_F(GetPhotographTest, TurnsUprightAsExifSays) {
  const SentPhotograph photograph = Get("cam0/turned.jpg");
  ASSERT_TRUE(photograph.status.ok()) << photograph.status.error_message();
  EXPECT_EQ(photograph.header.width(), 36);
  EXPECT_EQ(photograph.header.height(), 60);
  const Image image = photograph.Decoded();
  ASSERT_EQ(image.height, 60);
  EXPECT_GT(image.pixels[3 * (5 * 36 + 18)], 200) << "what was stored to the left is on top";
}

TEST_F(GetPhotographTest, ReturnsTheFirstByNameWithoutAName) {
  const SentPhotograph photograph = Get("");
  ASSERT_TRUE(photograph.status.ok()) << photograph.status.error_message();
  EXPECT_EQ(photograph.header.width(), 60) << "b.jpg, not cam0/turned.jpg";
}

TEST_F(GetPhotographTest, NamesMissingPhotographs) {
  for (const char* name : {"none.jpg", "images/b.jpg", "../images/b.jpg", "a.png"}) {
    const SentPhotograph photograph = Get(name);
    EXPECT_EQ(photograph.status.error_code(), grpc::NOT_FOUND) << name;
    EXPECT_EQ(DetailOf(photograph.status).reason(), "NO_SUCH_PHOTOGRAPH");
  }
  EXPECT_TRUE(absl::StrContains(Get("walk_000123.jpg").status.error_message(),
                                "it is a frame of videos/walk.mp4"));
  request.set_parent("scenes/shelf/datasets/9");
  EXPECT_EQ(Get("b.jpg").status.error_code(), grpc::NOT_FOUND);
  request.set_parent(running.CreateUpload("shelf", {{"images/b.jpg", upright}}).name());
  EXPECT_EQ(Get("b.jpg").status.error_code(), grpc::INVALID_ARGUMENT) << "an upload's name";
  request.set_parent("scenes/shelf/datasets/2");
  EXPECT_EQ(Get("b.jpg").status.error_code(), grpc::NOT_FOUND) << "not sealed";
}

TEST_F(GetPhotographTest, RefusesContradictoryFields) {
  request.set_max_side(-1);
  ExpectRefused("max_side", "[0, 16384]");
  request.set_max_side(16385);
  ExpectRefused("max_side", "[0, 16384]");
  request.set_max_side(100);
  request.set_original(true);
  ExpectRefused("max_side", "an original is not shrunk");
  request.set_max_side(0);
  request.set_frame(v1::PIXEL_FRAME_PHOTOGRAPH);
  ExpectRefused("frame", "an original is not warped");
}

TEST_F(GetPhotographTest, RefusesFilesThatDoNotDecode) {
  const SentPhotograph photograph = Get("text.jpg");
  EXPECT_EQ(photograph.status.error_code(), grpc::INVALID_ARGUMENT);
  EXPECT_TRUE(absl::StrContains(photograph.status.error_message(), "images/text.jpg: not a JPEG"))
      << photograph.status.error_message();
}

TEST_F(GetPhotographTest, DistinguishesDamagedFilesFromBadOnes) {
  std::string damaged = upright;
  damaged[damaged.size() / 2] ^= 1;
  for (const bool original : {false, true}) {
    std::ofstream(BlobOf(upright), std::ios::binary) << damaged;
    request.set_original(original);
    const grpc::Status flipped = Get("b.jpg").status;
    EXPECT_EQ(flipped.error_code(), grpc::DATA_LOSS) << flipped.error_message();
    EXPECT_TRUE(absl::StrContains(flipped.error_message(), "images/b.jpg: the stored file fails"));
  }
  std::ofstream(BlobOf(upright), std::ios::binary) << upright.substr(0, 100);
  EXPECT_EQ(Get("b.jpg").status.error_code(), grpc::DATA_LOSS) << "cut short";
  std::filesystem::remove(BlobOf(upright));
  EXPECT_EQ(Get("b.jpg").status.error_code(), grpc::DATA_LOSS) << "gone";
}

TEST_F(GetPhotographTest, SetsADamagedFileAsideForTheNextUpload) {
  const TestFile file = {"images/b.jpg", upright};
  for (const bool original : {false, true}) {
    std::string damaged = upright;
    damaged[damaged.size() / 2] ^= 1;
    std::ofstream(BlobOf(upright), std::ios::binary) << damaged;
    EXPECT_EQ(running.CreateUpload("shelf", {file}).missing_files_size(), 0);
    request.set_original(original);
    const grpc::Status status = Get("b.jpg").status;
    EXPECT_EQ(status.error_code(), grpc::DATA_LOSS);
    EXPECT_TRUE(absl::StrContains(status.error_message(), "; upload it again"))
        << status.error_message();
    const BlobName name = {kDefaultProject, Sha256Hex(upright)};
    EXPECT_TRUE(std::filesystem::exists(DamagedPath(running.options.data, name)));
    const v1::Upload again = running.CreateUpload("shelf", {file});
    ASSERT_EQ(again.missing_files_size(), 1);
    ASSERT_TRUE(running.Write(FileParts(again.name(), file)).ok());
    EXPECT_TRUE(Get("b.jpg").status.ok()) << "healed";
  }
}

// The decoder cannot reach the store from its sandbox, and the server does not trust its report.
TEST(GetPhotographOfALyingDecoder, KeepsAFileThatIsNotDamaged) {
  const testing::TempFolder folder;
  PhotographHeader header;
  header.code = absl::StatusCode::kDataLoss;
  const std::string message = "images/a.jpg: the stored file fails its SHA-256";
  header.num_bytes = static_cast<int64_t>(message.size());
  std::ofstream(folder / "answer", std::ios::binary) << FormatPhotographHeader(header) << message;
  std::ofstream(folder / "worker") << "#!/bin/sh\ncat " << (folder / "answer").string() << "\n";
  std::filesystem::permissions(folder / "worker", std::filesystem::perms::owner_all);
  RunningServer running((folder / "worker").string());
  running.CreateScene("shelf");
  v1::GetPhotographRequest request;
  request.set_parent(running.UploadAndSeal("shelf", {{"images/a.jpg", "bytes"}}));
  const grpc::Status status = Get(running, request).status;
  EXPECT_EQ(status.error_code(), grpc::DATA_LOSS);
  EXPECT_FALSE(absl::StrContains(status.error_message(), "upload it again"))
      << status.error_message();
  EXPECT_EQ(running.CountBlobFiles(), 1);
}

TEST_F(GetPhotographTest, LeavesNoFileBehind) {
  ASSERT_TRUE(Get("b.jpg").status.ok());
  EXPECT_TRUE(std::filesystem::is_empty(running.options.data / "scratch"));
}

// The dataset that the model was trained on, in the pixels of the model's prompts.
struct PhotographOfModel : ShelfModel {
  PhotographOfModel() {
    v1::TrainSceneRequest train;
    train.set_scene("scenes/shelf");
    train.set_dataset(running.UploadAndSeal(
        "shelf", {{"half.model", "bytes", v1::FILE_KIND_POSES},
                  {"images/middle.jpg", Turned(Jpeg(TwoColours(192, 128)), 6)}}));
    grpc::ClientContext context;
    v1::Job job;
    EXPECT_TRUE(running.jobs->TrainScene(&context, train, &job).ok());
    EXPECT_EQ(running.Await(job.name()).state(), v1::JOB_STATE_SUCCEEDED);
    request.set_parent(kModel);
    request.set_photograph("middle.jpg");
  }
  v1::GetPhotographRequest request;
};

TEST_F(PhotographOfModel, IsTurnedUpright) {
  const SentPhotograph photograph = Get(running, request);
  ASSERT_TRUE(photograph.status.ok()) << photograph.status.error_message();
  EXPECT_EQ(photograph.header.width(), 128);
  EXPECT_EQ(photograph.header.height(), 192);
}

TEST_F(PhotographOfModel, IsWarpedAsTheViewWasTrainedOn) {
  request.set_frame(v1::PIXEL_FRAME_VIEW);
  const SentPhotograph photograph = Get(running, request);
  ASSERT_TRUE(photograph.status.ok()) << photograph.status.error_message();
  EXPECT_EQ(photograph.header.width(), kWidth);
  EXPECT_EQ(photograph.header.height(), kHeight);
  const Image image = photograph.Decoded();
  ASSERT_EQ(image.width, kWidth);
  EXPECT_GT(image.pixels[3 * (32 * kWidth + 5)], 200) << "as stored: red to the left";
  EXPECT_LT(image.pixels[3 * (32 * kWidth + 90)], 60) << "blue to the right";
}

TEST_F(PhotographOfModel, IsWarpedAlsoIfNoPhotographIsNamed) {
  request.set_frame(v1::PIXEL_FRAME_VIEW);
  request.clear_photograph();
  const SentPhotograph photograph = Get(running, request);
  ASSERT_TRUE(photograph.status.ok()) << photograph.status.error_message();
  EXPECT_EQ(photograph.header.width(), kWidth);
}

TEST_F(PhotographOfModel, RefusesViewsThatTheModelDoesNotHave) {
  request.set_frame(v1::PIXEL_FRAME_VIEW);
  request.set_parent("scenes/shelf/datasets/2");
  EXPECT_EQ(Get(running, request).status.error_code(), grpc::INVALID_ARGUMENT) << "no model";
  request.set_parent("scenes/shelf/models/1");  // of a dataset whose only file is "file"
  request.set_photograph("file");
  const grpc::Status status = Get(running, request).status;
  EXPECT_EQ(status.error_code(), grpc::INVALID_ARGUMENT);
  EXPECT_EQ(DetailOf(status).field(), "photograph") << status.error_message();
}

// A worker that writes its process id, keeps a file while it runs, and takes a given time.
struct SlowWorker : ::testing::Test {
  SlowWorker() {
    std::filesystem::create_directories(folder / "running");
    const std::string here = folder.path().string();
    std::ofstream(folder / "worker")
        << "#!/bin/sh\necho $$ > " << here << "/running/$$\nls " << here << "/running | wc -l >> "
        << here << "/counts\nsleep $(cat " << here << "/seconds)\nrm " << here
        << "/running/$$\nexit 1\n";
    std::filesystem::permissions(folder / "worker", std::filesystem::perms::owner_all);
    running = std::make_unique<RunningServer>((folder / "worker").string());
    running->CreateScene("shelf");
    request.set_parent(running->UploadAndSeal("shelf", {{"images/a.jpg", "bytes"}}));
  }
  void Take(const std::string& seconds) const { std::ofstream(folder / "seconds") << seconds; }
  // Ids of processes that have started and not ended by themselves.
  std::set<pid_t> Begun() const {
    std::set<pid_t> begun;
    for (const auto& entry : std::filesystem::directory_iterator(folder / "running")) {
      begun.insert(std::stoi(entry.path().filename().string()));
    }
    return begun;
  }

  testing::TempFolder folder;
  std::unique_ptr<RunningServer> running;
  v1::GetPhotographRequest request;
};

TEST_F(SlowWorker, IsKilledWhenItsCallerLeaves) {
  Take("600");
  grpc::ClientContext context;
  const auto stream = running->datasets->GetPhotograph(&context, request);
  while (Begun().empty()) absl::SleepFor(absl::Milliseconds(10));
  const pid_t worker = *Begun().begin();
  EXPECT_EQ(kill(worker, 0), 0);
  context.TryCancel();
  EXPECT_EQ(stream->Finish().error_code(), grpc::CANCELLED);
  const absl::Time deadline = absl::Now() + absl::Seconds(30);
  while (kill(worker, 0) == 0 && absl::Now() < deadline) absl::SleepFor(absl::Milliseconds(10));
  EXPECT_NE(kill(worker, 0), 0) << "process " << worker << " is left";
}

TEST_F(SlowWorker, IsKilledWhenTheServerStops) {
  Take("600");
  grpc::ClientContext context;
  const auto stream = running->datasets->GetPhotograph(&context, request);
  while (Begun().empty()) absl::SleepFor(absl::Milliseconds(10));
  const pid_t worker = *Begun().begin();
  const absl::Time start = absl::Now();
  running->server->Shutdown(absl::Now() + absl::Seconds(20));
  EXPECT_LT(absl::Now() - start, absl::Seconds(20));
  EXPECT_NE(kill(worker, 0), 0) << "process " << worker << " is left";
  EXPECT_EQ(stream->Finish().error_code(), grpc::UNAVAILABLE);
}

TEST_F(SlowWorker, RunsTwiceAtOnceAtMost) {
  Take("0.2");
  std::vector<std::thread> callers;
  for (int i = 0; i < 6; ++i) {
    callers.emplace_back(
        [this] { EXPECT_EQ(Get(*running, request).status.error_code(), grpc::INTERNAL); });
  }
  for (std::thread& caller : callers) caller.join();
  std::ifstream counts(folder / "counts");
  int num_runs = 0;
  for (int count = 0; counts >> count; ++num_runs) EXPECT_LE(count, 2);
  EXPECT_EQ(num_runs, 6);
}

}  // namespace
}  // namespace pepeseg
