#pragma once

#include <memory>
#include <string>
#include <vector>

#include "grpcpp/channel.h"
#include "pepeseg/v1/admin_service.grpc.pb.h"
#include "pepeseg/v1/dataset_service.grpc.pb.h"
#include "pepeseg/v1/errors.pb.h"
#include "pepeseg/v1/evaluation_service.grpc.pb.h"
#include "pepeseg/v1/job_service.grpc.pb.h"
#include "pepeseg/v1/label_service.grpc.pb.h"
#include "pepeseg/v1/render_service.grpc.pb.h"
#include "pepeseg/v1/scene_service.grpc.pb.h"
#include "pepeseg/v1/segmentation_service.grpc.pb.h"
#include "pepeseg/v1/selection_service.grpc.pb.h"
#include "server/server.h"
#include "tests/testing/temp_folder.h"

namespace pepeseg {

struct TestFile {
  std::string path;
  std::string bytes;
  v1::FileKind kind = v1::FILE_KIND_IMAGE;
};

v1::FileDeclaration Declare(const TestFile& file);
// Returns the error of a call with its details as fields. Fails the test if there is another
// detail, such as the mark of a private error.
v1::Error DetailOf(const grpc::Status& status);
// Parts of a WriteFiles stream.
v1::WriteFilesRequest HeaderPart(const std::string& upload, const std::string& path,
                                 int64_t offset = 0);
v1::WriteFilesRequest ChunkPart(const std::string& bytes);
v1::WriteFilesRequest EndPart();
// Returns all parts of a file, in chunks of `chunk_bytes`.
std::vector<v1::WriteFilesRequest> FileParts(const std::string& upload, const TestFile& file,
                                             size_t chunk_bytes = 1 << 20);

// Returns the default options with an admin listener.
inline ServerOptions WithAdmin() {
  ServerOptions options;
  options.admin = "127.0.0.1:0";
  return options;
}

// A server in the test's process. Tests call it over an in-process channel, or over its socket.
struct RunningServer {
  // Starts a server with `settings`, except for the data folder, the worker and the device.
  explicit RunningServer(const std::string& worker, const ServerOptions& settings = {});

  // Ends the server, and starts it on the same data with the current `options`.
  void Restart();

  // The calls of most tests. A status that is not OK fails the test.
  void CreateScene(const std::string& id);
  v1::Upload CreateUpload(const std::string& scene, const std::vector<TestFile>& files);
  grpc::Status Write(const std::vector<v1::WriteFilesRequest>& parts,
                     v1::WriteFilesResponse* response = nullptr);
  v1::Upload GetUpload(const std::string& name);
  std::string UploadAndSeal(const std::string& scene, const std::vector<TestFile>& files);
  // Trains a new dataset with one file of that name, by which a fake worker decides what to do.
  v1::Job Train(const std::string& scene, const std::string& file);
  // Waits up to one minute until the job has ended.
  v1::Job Await(const std::string& job);
  int64_t CountBlobFiles() const;
  // Returns the names of partial uploads.
  int64_t CountPartialFiles() const;

  testing::TempFolder folder;
  ServerOptions options;
  std::unique_ptr<Server> server;
  std::shared_ptr<grpc::Channel> channel;
  std::unique_ptr<v1::SceneService::Stub> scenes;
  std::unique_ptr<v1::DatasetService::Stub> datasets;
  std::unique_ptr<v1::JobService::Stub> jobs;
  std::unique_ptr<v1::SegmentationService::Stub> segmentation;
  std::unique_ptr<v1::LabelService::Stub> labels;
  std::unique_ptr<v1::SelectionService::Stub> selections;
  std::unique_ptr<v1::RenderService::Stub> renders;
  std::unique_ptr<v1::EvaluationService::Stub> evaluations;
  std::unique_ptr<v1::AdminService::Stub> admin;  // null unless options.admin is set
};

}  // namespace pepeseg
