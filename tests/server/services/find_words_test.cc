// Words of the detector and of the text command.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <filesystem>
#include <fstream>
#include <random>
#include <string>
#include <thread>

#include "core/formats/images.h"
#include "tests/server/shelf_model.h"
#include "tests/testing/fake_sam.h"

namespace pepeseg {
namespace {

using ::testing::ElementsAre;
using ::testing::IsSupersetOf;
using Response = v1::FindSegmentsResponse;

// The model has no photographs, so its renderings are searched. Red is segment 1, blue is 2.
struct FindWords : ShelfModel {
  Reply<Response> Find(const std::string& text) {
    v1::FindSegmentsRequest request;
    request.set_model(kModel);
    request.set_text(text);
    return Call(&SegmentationStub::FindSegments, request);
  }
};

// The fake detector knows "apple", which is red, and "ball", which is blue.
struct FindWordsOfDetector : FindWords {
  FindWordsOfDetector() {
    testing::MakeFakeDetector(detector);
    running.options.detector = detector;
    running.Restart();
  }
  const std::filesystem::path detector = running.folder / "detector";
};

TEST_F(FindWordsOfDetector, FindTheirThings) {
  ASSERT_OK_AND_ASSIGN(const auto apple, Find("apple"));
  EXPECT_EQ(apple.source(), Response::SOURCE_DETECTOR);
  ASSERT_EQ(apple.found_size(), 1);
  EXPECT_EQ(apple.found(0).word(), "apple");
  EXPECT_EQ(apple.found(0).segment().id(), 1);
  EXPECT_GT(apple.found(0).score(), 0.6);
  EXPECT_LE(apple.found(0).score(), 0.8);
  EXPECT_GT(apple.found(0).appearances_size(), 1);
  for (const char* blue : {"ball", "Balls", " the ball "}) {
    ASSERT_OK_AND_ASSIGN(const auto ball, Find(blue));
    ASSERT_EQ(ball.found_size(), 1) << blue;
    EXPECT_EQ(ball.found(0).segment().id(), 2) << blue;
  }
}

TEST_F(FindWordsOfDetector, AreListedWhereATextIsNoneOfThem) {
  ASSERT_OK_AND_ASSIGN(const auto none, Find("aple"));
  EXPECT_EQ(none.found_size(), 0);
  EXPECT_THAT(none.known_words(), IsSupersetOf({"apple", "ball"}));
  EXPECT_THAT(none.did_you_mean(), ElementsAre("apple"));
}

TEST_F(FindWordsOfDetector, FindNothingWhereTheDetectorIsNotSure) {
  v1::FindSegmentsRequest request;
  request.set_model(kModel);
  request.set_text("apple");
  request.set_min_score(0.9);
  ASSERT_OK_AND_ASSIGN(const auto none, Call(&SegmentationStub::FindSegments, request));
  EXPECT_EQ(none.found_size(), 0);
  EXPECT_EQ(none.best_word(), "apple");
  EXPECT_GT(none.best_score(), 0.6);
}

TEST_F(FindWordsOfDetector, FailAloneWhereTheDetectorIsDamaged) {
  std::ofstream(detector / "detector.onnx") << "another";
  EXPECT_ERROR(Find("apple"), grpc::FAILED_PRECONDITION,
               {.message = "the detector of words cannot be loaded"});
  EXPECT_EQ(Find("pear")->found_size(), 0);
}

TEST_F(FindWordsOfDetector, AreSaidInTheStatus) {
  running.options.admin = "127.0.0.1:0";
  running.Restart();
  const auto sources = Call(&AdminStub::GetServerStatus, {})->find_sources();
  EXPECT_EQ(sources.num_detector_words(), 2);
  EXPECT_FALSE(sources.text_command());
  EXPECT_FALSE(sources.appearance());
}

struct FindWordsOfCommand : FindWords {
  FindWordsOfCommand() {
    SetProgram("exit 3");
    running.options.text_command = program;
    running.options.text_seconds = 60;
    running.Restart();
  }
  void SetProgram(const std::string& script) const {
    std::ofstream(program) << "#!/bin/sh\n" << script;
    EXPECT_EQ(chmod(program.c_str(), 0700), 0);
  }
  // A program that finds `thing` in each photograph.
  void Answer(const std::string& thing) const {
    SetProgram(R"(for photo in "$2"/*; do
      name=${photo##*/}
      echo '[)" +
               thing + R"(]' >"$6/${name%.png}.json"
    done)");
  }
  const std::string program = running.folder / "find";
};

TEST_F(FindWordsOfCommand, FindWhatItsBoxesFit) {
  Answer(R"({"score": 0.9, "box": [51, 17, 81, 47]})");
  ASSERT_OK_AND_ASSIGN(const auto found, Find("the blue thing"));
  EXPECT_EQ(found.source(), Response::SOURCE_TEXT_COMMAND);
  ASSERT_EQ(found.found_size(), 1);
  EXPECT_EQ(found.found(0).segment().id(), 2);
  EXPECT_EQ(found.found(0).word(), "the blue thing");
  // Kept: the program does not run again.
  SetProgram("exit 3");
  ASSERT_OK_AND_ASSIGN(const auto kept, Find("the blue thing"));
  EXPECT_EQ(kept.found_size(), 1);
}

TEST_F(FindWordsOfCommand, FindNothingWhereItFindsNothing) {
  SetProgram("exit 0");
  ASSERT_OK_AND_ASSIGN(const auto none, Find("a unicorn"));
  EXPECT_EQ(none.found_size(), 0);
  ASSERT_OK_AND_ASSIGN(const auto option, Find("--out"));
  EXPECT_EQ(option.found_size(), 0);
}

// The photograph is noise, which no rendering is.
TEST_F(FindWordsOfCommand, LooksAtRenderingsOfAnEditedModel) {
  std::mt19937 random(1);
  Image noise{2 * kWidth, 2 * kHeight, 3, {}};  // as of the model's photographs
  for (int i = 0; i < 3 * noise.width * noise.height; ++i) {
    noise.pixels.push_back(static_cast<uint8_t>(random() % 256));
  }
  v1::TrainSceneRequest train;
  train.set_scene("scenes/shelf");
  train.set_dataset(
      running.UploadAndSeal("shelf", {{"half.model", "bytes", v1::FILE_KIND_POSES},
                                      {"images/middle.jpg", *EncodeJpeg(noise, 95)}}));
  const v1::Job job = *Call(&JobStub::TrainScene, train);
  ASSERT_EQ(running.Await(job.name()).state(), v1::JOB_STATE_SUCCEEDED);
  // An image of noise is a large file.
  SetProgram(R"(for photo in "$2"/*; do
      if [ $(wc -c <"$photo") -gt 12000 ]; then exit 9; fi
    done)");
  EXPECT_ERROR(Find("apple"), grpc::FAILED_PRECONDITION, {.message = "exited with code 9"});
  v1::EditModelRequest edit;
  edit.set_model(kModel);
  SetSegment(1, 1, *edit.mutable_subset());
  edit.mutable_recolor()->set_green(1);
  grpc::ClientContext context;
  const auto stream = running.edits->EditModel(&context, edit);
  for (v1::EditModelResponse part; stream->Read(&part);) {
  }
  ASSERT_OK(stream->Finish());
  EXPECT_OK(Find("apple"));
}

TEST_F(FindWordsOfCommand, DoNotKeepOthersWaiting) {
  running.options.admin = "127.0.0.1:0";
  running.Restart();
  SetProgram("sleep 60");
  grpc::ClientContext slow;
  std::thread finder([&] {
    v1::FindSegmentsRequest request;
    request.set_model(kModel);
    request.set_text("the slow thing");
    v1::FindSegmentsResponse response;
    EXPECT_EQ(running.segmentation->FindSegments(&slow, request, &response).error_code(),
              grpc::StatusCode::CANCELLED);
  });
  const auto num_busy = [this](v1::ServerStatus::Work work) {
    const auto status = Call(&AdminStub::GetServerStatus, {});
    for (const auto& pool : status->pools()) {
      if (pool.work() == work) return pool.num_busy();
    }
    return -1;
  };
  EXPECT_TRUE(Eventually([&] { return num_busy(v1::ServerStatus::WORK_FIND) == 1; }));
  v1::DecomposeModelRequest decompose;
  decompose.set_model(kModel);
  EXPECT_OK(Call(&SegmentationStub::DecomposeModel, decompose));
  EXPECT_EQ(num_busy(v1::ServerStatus::WORK_FIND), 1) << "the program still runs";
  // The pool's thread is free only a moment after its answer is sent.
  EXPECT_TRUE(Eventually([&] { return num_busy(v1::ServerStatus::WORK_EVALUATION) == 0; }));
  slow.TryCancel();
  finder.join();
}

TEST_F(FindWordsOfCommand, FailTheRequestOnlyWhereItFails) {
  EXPECT_ERROR(Find("cup"), grpc::FAILED_PRECONDITION,
               {.message = "the text command find: exited with code 3"});
  SetProgram("kill -SEGV $$");
  EXPECT_ERROR(Find("cup"), grpc::FAILED_PRECONDITION, {.message = "was killed by signal 11"});
  Answer(R"({"score": 0.9})");
  EXPECT_ERROR(Find("cup"), grpc::FAILED_PRECONDITION,
               {.message = "000001.json: thing 1: has neither"});
  Answer(R"({"score": 0.9, "box": [15, 17, 45, 47]})");
  ASSERT_OK_AND_ASSIGN(const auto found, Find("cup"));
  ASSERT_EQ(found.found_size(), 1);
  EXPECT_EQ(found.found(0).segment().id(), 1);
  // Nothing is left of the runs.
  for (const auto& entry : std::filesystem::directory_iterator(running.options.data / "scratch")) {
    ADD_FAILURE() << entry.path();
  }
}

}  // namespace
}  // namespace pepeseg
