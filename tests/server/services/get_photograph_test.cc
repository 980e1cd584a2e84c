#include <gtest/gtest.h>

#include <csignal>
#include <fstream>
#include <set>
#include <thread>

#include "absl/time/clock.h"
#include "core/base/digest.h"
#include "core/base/file_io.h"
#include "core/formats/images.h"
#include "server/store/layout.h"
#include "server/store/records.h"
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
  EXPECT_OK(jpeg);
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
    EXPECT_OK(image);
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
    EXPECT_LE(part.chunk().size(), size_t{1} << 20);
    photograph.bytes += part.chunk();
  }
  photograph.status = stream->Finish();
  return photograph;
}

struct GetPhotographTest : EmptyScene {
  GetPhotographTest() : EmptyScene(PEPESEG_WORKER) {
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
    EXPECT_ERROR(Get("b.jpg").status, grpc::INVALID_ARGUMENT, field, words);
  }
  std::filesystem::path BlobOf(const std::string& bytes) const {
    return BlobPath(running.options.data, {kDefaultProject, Sha256Hex(bytes)});
  }

  std::string upright, large;
  v1::GetPhotographRequest request;
};

TEST_F(GetPhotographTest, ReturnsTheBytesThatWereUploaded) {
  request.set_original(true);
  for (const auto& [name, bytes] : {std::pair("b.jpg", upright), std::pair("large.jpg", large)}) {
    const SentPhotograph photograph = Get(name);
    ASSERT_OK(photograph.status);
    EXPECT_EQ(photograph.header.content_type(), "image/jpeg");
    EXPECT_EQ(photograph.header.width(), name == std::string("b.jpg") ? 60 : 30);
    EXPECT_EQ(photograph.header.num_bytes(), static_cast<int64_t>(bytes.size()));
    EXPECT_TRUE(photograph.bytes == bytes) << name;
  }
}

TEST_F(GetPhotographTest, DecodesAndShrinks) {
  const SentPhotograph whole = Get("b.jpg");
  ASSERT_OK(whole.status);
  EXPECT_EQ(whole.header.content_type(), "image/jpeg");
  EXPECT_EQ(whole.header.num_bytes(), static_cast<int64_t>(whole.bytes.size()));
  EXPECT_EQ(whole.Decoded().width, 60);
  request.set_max_side(30);
  const SentPhotograph half = Get("b.jpg");
  ASSERT_OK(half.status);
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
  ASSERT_OK(photograph.status);
  EXPECT_EQ(photograph.header.width(), 36);
  EXPECT_EQ(photograph.header.height(), 60);
  const Image image = photograph.Decoded();
  ASSERT_EQ(image.height, 60);
  EXPECT_GT(image.pixels[3 * (5 * 36 + 18)], 200) << "what was stored to the left is on top";
}

TEST_F(GetPhotographTest, ReturnsTheFirstByNameWithoutAName) {
  const SentPhotograph photograph = Get("");
  ASSERT_OK(photograph.status);
  EXPECT_EQ(photograph.header.width(), 60) << "b.jpg, not cam0/turned.jpg";
}

TEST_F(GetPhotographTest, NamesMissingPhotographs) {
  for (const char* name : {"none.jpg", "images/b.jpg", "../images/b.jpg", "a.png"}) {
    EXPECT_ERROR(Get(name).status, grpc::NOT_FOUND, {.reason = "NO_SUCH_PHOTOGRAPH"}) << name;
  }
  EXPECT_ERROR(Get("walk_000123.jpg").status, grpc::NOT_FOUND,
               {.message = "it is a frame of videos/walk.mp4"});
  request.set_parent("scenes/shelf/datasets/9");
  EXPECT_ERROR(Get("b.jpg").status, grpc::NOT_FOUND);
  request.set_parent(running.CreateUpload("shelf", {{"images/b.jpg", upright}}).name());
  EXPECT_ERROR(Get("b.jpg").status, grpc::INVALID_ARGUMENT) << "an upload's name";
  request.set_parent("scenes/shelf/datasets/2");
  EXPECT_ERROR(Get("b.jpg").status, grpc::NOT_FOUND) << "not sealed";
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
  EXPECT_ERROR(Get("text.jpg").status, grpc::INVALID_ARGUMENT,
               {.message = "images/text.jpg: not a JPEG"});
}

TEST_F(GetPhotographTest, DistinguishesDamagedFilesFromBadOnes) {
  std::string damaged = upright;
  damaged[damaged.size() / 2] ^= 1;
  for (const bool original : {false, true}) {
    std::ofstream(BlobOf(upright), std::ios::binary) << damaged;
    request.set_original(original);
    EXPECT_ERROR(Get("b.jpg").status, grpc::DATA_LOSS,
                 {.message = "images/b.jpg: the stored file fails"});
  }
  std::ofstream(BlobOf(upright), std::ios::binary) << upright.substr(0, 100);
  EXPECT_ERROR(Get("b.jpg").status, grpc::DATA_LOSS) << "cut short";
  std::filesystem::remove(BlobOf(upright));
  EXPECT_ERROR(Get("b.jpg").status, grpc::DATA_LOSS) << "gone";
}

TEST_F(GetPhotographTest, SetsADamagedFileAsideForTheNextUpload) {
  const TestFile file = {"images/b.jpg", upright};
  for (const bool original : {false, true}) {
    std::string damaged = upright;
    damaged[damaged.size() / 2] ^= 1;
    std::ofstream(BlobOf(upright), std::ios::binary) << damaged;
    EXPECT_EQ(running.CreateUpload("shelf", {file}).missing_files_size(), 0);
    request.set_original(original);
    EXPECT_ERROR(Get("b.jpg").status, grpc::DATA_LOSS, {.message = "; upload it again"});
    const BlobName name = {kDefaultProject, Sha256Hex(upright)};
    EXPECT_TRUE(std::filesystem::exists(DamagedPath(running.options.data, name)));
    const v1::Upload again = running.CreateUpload("shelf", {file});
    ASSERT_EQ(again.missing_files_size(), 1);
    ASSERT_OK(running.Write(FileParts(again.name(), file)));
    EXPECT_OK(Get("b.jpg").status) << "healed";
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
  EXPECT_ERROR(status, grpc::DATA_LOSS);
  EXPECT_THAT(status.error_message(), ::testing::Not(::testing::HasSubstr("upload it again")));
  EXPECT_EQ(running.CountBlobFiles(), 1);
}

TEST_F(GetPhotographTest, LeavesNoFileBehind) {
  ASSERT_OK(Get("b.jpg").status);
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
    const v1::Job job = *Call(&JobStub::TrainScene, train);
    EXPECT_EQ(running.Await(job.name()).state(), v1::JOB_STATE_SUCCEEDED);
    request.set_parent(kModel);
    request.set_photograph("middle.jpg");
  }
  v1::GetPhotographRequest request;
};

TEST_F(PhotographOfModel, IsTurnedUpright) {
  const SentPhotograph photograph = Get(running, request);
  ASSERT_OK(photograph.status);
  EXPECT_EQ(photograph.header.width(), 128);
  EXPECT_EQ(photograph.header.height(), 192);
}

TEST_F(PhotographOfModel, IsWarpedAsTheViewWasTrainedOn) {
  request.set_frame(v1::PIXEL_FRAME_VIEW);
  const SentPhotograph photograph = Get(running, request);
  ASSERT_OK(photograph.status);
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
  ASSERT_OK(photograph.status);
  EXPECT_EQ(photograph.header.width(), kWidth);
}

TEST_F(PhotographOfModel, RefusesViewsThatTheModelDoesNotHave) {
  request.set_frame(v1::PIXEL_FRAME_VIEW);
  request.set_parent("scenes/shelf/datasets/2");
  EXPECT_ERROR(Get(running, request).status, grpc::INVALID_ARGUMENT) << "no model";
  request.set_parent("scenes/shelf/models/1");  // of a dataset whose only file is "file"
  request.set_photograph("file");
  EXPECT_ERROR(Get(running, request).status, grpc::INVALID_ARGUMENT, "photograph");
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

  // Waits until a process has started and returns its id.
  pid_t AwaitWorker() const {
    EXPECT_TRUE(Eventually([this] { return !Begun().empty(); }));
    return Begun().empty() ? -1 : *Begun().begin();
  }

  testing::TempFolder folder;
  std::unique_ptr<RunningServer> running;
  v1::GetPhotographRequest request;
};

TEST_F(SlowWorker, IsKilledWhenItsCallerLeaves) {
  Take("600");
  grpc::ClientContext context;
  const auto stream = running->datasets->GetPhotograph(&context, request);
  const pid_t worker = AwaitWorker();
  ASSERT_GT(worker, 0);
  EXPECT_EQ(kill(worker, 0), 0);
  context.TryCancel();
  EXPECT_ERROR(stream->Finish(), grpc::CANCELLED);
  EXPECT_TRUE(Eventually([&] { return kill(worker, 0) != 0; }, absl::Seconds(30)))
      << "process " << worker << " is left";
}

TEST_F(SlowWorker, IsKilledWhenTheServerStops) {
  Take("600");
  grpc::ClientContext context;
  const auto stream = running->datasets->GetPhotograph(&context, request);
  const pid_t worker = AwaitWorker();
  ASSERT_GT(worker, 0);
  const absl::Time start = absl::Now();
  running->server->Shutdown(absl::Now() + absl::Seconds(20));
  EXPECT_LT(absl::Now() - start, absl::Seconds(20));
  EXPECT_NE(kill(worker, 0), 0) << "process " << worker << " is left";
  EXPECT_ERROR(stream->Finish(), grpc::UNAVAILABLE);
}

TEST_F(SlowWorker, RunsTwiceAtOnceAtMost) {
  Take("0.2");
  std::vector<std::thread> callers;
  for (int i = 0; i < 6; ++i) {
    callers.emplace_back([this] { EXPECT_ERROR(Get(*running, request).status, grpc::INTERNAL); });
  }
  for (std::thread& caller : callers) caller.join();
  std::ifstream counts(folder / "counts");
  int num_runs = 0;
  for (int count = 0; counts >> count; ++num_runs) EXPECT_LE(count, 2);
  EXPECT_EQ(num_runs, 6);
}

TEST_F(SlowWorker, IsNotStartedAgainForAFileThatDidNotDecode) {
  std::ofstream(folder / "worker")
      << "#!/bin/sh\necho x >> " << folder.path().string() << "/counts\nkill -9 $$\n";
  for (int i = 0; i < 3; ++i) {
    EXPECT_ERROR(Get(*running, request).status, grpc::INVALID_ARGUMENT,
                 {.message = "images/a.jpg: does not decode: the decoder was killed by signal 9"});
  }
  ASSERT_OK_AND_ASSIGN(const std::string counts, ReadFile(folder / "counts", "counts", 100));
  EXPECT_EQ(counts, "x\n");
}

}  // namespace
}  // namespace pepeseg
