#pragma once

#include <memory>
#include <source_location>
#include <string>
#include <vector>

#include "server/server.h"
#include "tests/server/call.h"
#include "tests/testing/temp_folder.h"

namespace pepeseg {

struct TestFile {
  std::string path;
  std::string bytes;
  v1::FileKind kind = v1::FILE_KIND_IMAGE;
};

v1::FileDeclaration Declare(const TestFile& file);
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

  // Returns the channel of a service: AdminService has its own listener.
  template <class Stub>
  std::shared_ptr<grpc::Channel> ChannelOf() const {
    return std::is_same_v<Stub, AdminStub> ? server->InProcessAdminChannel() : channel;
  }
  // Calls a method of any service.
  template <class Stub, class Request, class Response>
  Reply<Response> Call(Method<Stub, Request, Response> method,
                       const std::type_identity_t<Request>& request,
                       std::source_location where = std::source_location::current()) const {
    return CallOver(ChannelOf<Stub>(), method, request, where);
  }

  // The calls of most tests. A status that is not OK fails the test.
  void CreateScene(const std::string& id) const;
  v1::Upload CreateUpload(const std::string& scene, const std::vector<TestFile>& files) const;
  grpc::Status Write(const std::vector<v1::WriteFilesRequest>& parts,
                     v1::WriteFilesResponse* response = nullptr);
  v1::Upload GetUpload(const std::string& name) const;
  std::string UploadAndSeal(const std::string& scene, const std::vector<TestFile>& files);
  // Trains a new dataset with one file of that name, by which a fake worker decides what to do.
  v1::Job Train(const std::string& scene, const std::string& file);
  // Waits up to one minute until the job has ended.
  v1::Job Await(const std::string& job) const;
  int64_t CountBlobFiles() const;
  // Returns the names of partial uploads.
  int64_t CountPartialFiles() const;

  testing::TempFolder folder;
  ServerOptions options;
  std::unique_ptr<Server> server;
  std::shared_ptr<grpc::Channel> channel;
  // For streams; Call() makes unary calls.
  std::unique_ptr<DatasetStub> datasets;
  std::unique_ptr<JobStub> jobs;
  std::unique_ptr<SegmentationStub> segmentation;
  std::unique_ptr<EditStub> edits;
  std::unique_ptr<RenderStub> renders;
  std::unique_ptr<EvaluationStub> evaluations;
};

}  // namespace pepeseg
