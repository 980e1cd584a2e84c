#pragma once

#include <grpcpp/grpcpp.h>

#include <memory>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "pepeseg/v1/dataset_service.grpc.pb.h"
#include "pepeseg/v1/job_service.grpc.pb.h"
#include "pepeseg/v1/scene_service.grpc.pb.h"
#include "pepeseg/v1/segmentation_service.grpc.pb.h"

namespace pepeseg {

// A scene from its creation to a deleted label, as a client does it that may lose its server at any
// call: every create has a request_id, and after a loss all is asked for again from the start. What
// was answered once must be answered alike for ever: anything else is an error of code DATA_LOSS.
// The server's worker is tests/server/rpc/model_worker.cc.
class LifeOfAScene {
 public:
  // The scene's id; its files are made from it.
  explicit LifeOfAScene(std::string id) : id_(std::move(id)) {}

  // All of it, from the start; what was done before is asked for again. UNAVAILABLE and what else
  // gRPC says of a lost server: go on later.
  absl::Status Run(const std::shared_ptr<grpc::Channel>& channel);
  // Whether what was answered so far is there.
  absl::Status Check(const std::shared_ptr<grpc::Channel>& channel);
  // The scene with all that belongs to it.
  absl::Status Delete(const std::shared_ptr<grpc::Channel>& channel);
  bool done() const { return done_; }

 private:
  struct Stubs;
  absl::Status Remember(std::string& known, const std::string& answer, const char* what);
  absl::Status Upload(Stubs& stubs);
  absl::Status WriteMissing(Stubs& stubs, const v1::Upload& upload);
  absl::Status Train(Stubs& stubs);
  absl::Status Ask(Stubs& stubs);
  absl::Status Keep(Stubs& stubs);

  const std::string id_;
  std::string scene_, upload_, dataset_, job_, model_, mask_, label_, selection_, second_;
  bool label_deleted_ = false;
  bool done_ = false;
};

}  // namespace pepeseg
