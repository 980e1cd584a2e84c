#pragma once

#include <grpcpp/grpcpp.h>

#include <memory>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "pepeseg/v1/dataset_service.grpc.pb.h"
#include "pepeseg/v1/job_service.grpc.pb.h"
#include "pepeseg/v1/label_service.grpc.pb.h"
#include "pepeseg/v1/scene_service.grpc.pb.h"
#include "pepeseg/v1/segmentation_service.grpc.pb.h"
#include "pepeseg/v1/selection_service.grpc.pb.h"

namespace pepeseg {

// The life of a scene, from its creation to a deleted label, run by a client that may lose its
// server at any call. Each creation has a request_id, and after a loss the client repeats all calls
// from the start. An answer that differs from an earlier one to the same call is an error,
// DATA_LOSS. The server's worker is tests/server/model_worker.cc.
class LifeOfAScene {
 public:
  // Takes the scene's id. The bytes of its files depend on it.
  explicit LifeOfAScene(std::string id) : id_(std::move(id)) {}

  // Makes all calls from the start, and repeats those that were made before. UNAVAILABLE, or
  // another code with which gRPC reports a lost server: call it again later.
  absl::Status Run(const std::shared_ptr<grpc::Channel>& channel);
  // Checks that everything that was acknowledged so far exists.
  absl::Status Check(const std::shared_ptr<grpc::Channel>& channel);
  // Deletes the scene and everything in it.
  absl::Status Delete(const std::shared_ptr<grpc::Channel>& channel);
  bool done() const { return done_; }
  // Returns whether the last error is a wrong answer that this client found, and not the server's
  // error.
  bool found_wrong() const { return found_wrong_; }
  // Allows trainings to end as FAILED: Run() then returns the job's error, and the next Run()
  // trains again.
  void LetTrainingFail() { may_fail_ = true; }

  const std::string& scene() const { return scene_; }
  const std::string& dataset() const { return dataset_; }
  const std::string& job() const { return job_; }
  const std::string& model() const { return model_; }
  const std::string& selection() const { return selection_; }

 private:
  struct Stubs;
  absl::Status Wrong(const std::string& what);
  absl::Status Remember(std::string& known, const std::string& answer, const char* what);
  absl::Status Upload(Stubs& stubs);
  absl::Status WriteMissing(Stubs& stubs, const v1::Upload& upload);
  absl::Status Train(Stubs& stubs);
  absl::Status Ask(Stubs& stubs);
  absl::Status Keep(Stubs& stubs);

  const std::string id_;
  std::string scene_, upload_, dataset_, job_, model_, mask_, label_, selection_, second_;
  bool label_deleted_ = false;
  bool may_fail_ = false;
  int num_failed_ = 0;  // number of failed trainings
  bool found_wrong_ = false;
  bool done_ = false;
};

}  // namespace pepeseg
