#pragma once

#include <gtest/gtest.h>

#include "pepeseg/v1/render_service.pb.h"
#include "tests/server/running_server.h"

namespace pepeseg {

constexpr int kWidth = 96, kHeight = 64;  // size of the views of model_worker.cc

// A server with the model of model_worker.cc as "scenes/shelf/models/1": a red square at pixels
// around (30, 32) of view middle.jpg and a blue one around (66, 32), 2 units away. Each has 10,000
// Gaussians and is one segment of every granularity level: red is 1, blue is 2.
struct ShelfModel : ::testing::Test {
  ShelfModel() : running(PEPESEG_MODEL_WORKER) {
    running.CreateScene("shelf");
    const v1::Job job = running.Await(running.Train("shelf", "file").name());
    EXPECT_EQ(job.state(), v1::JOB_STATE_SUCCEEDED) << job.DebugString();
  }
  static void SetSegment(int level, int id, v1::Subset& subset) {
    subset.mutable_segment()->set_level(level);
    subset.mutable_segment()->set_id(id);
  }
  static void ExpectRefused(const grpc::Status& status, const std::string& field,
                            const std::string& words) {
    EXPECT_EQ(status.error_code(), grpc::INVALID_ARGUMENT) << words;
    EXPECT_EQ(DetailOf(status).field(), field) << status.error_message();
    EXPECT_NE(status.error_message().find(words), std::string::npos) << status.error_message();
  }
  static constexpr char kModel[] = "scenes/shelf/models/live";

  RunningServer running;
};

}  // namespace pepeseg
