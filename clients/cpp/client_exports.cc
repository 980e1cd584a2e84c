// The client's exports: files that the server streams.
#include <memory>
#include <string>

#include "absl/strings/str_cat.h"
#include "clients/cpp/call.h"
#include "clients/cpp/client.h"
#include "clients/cpp/digest.h"
#include "clients/cpp/file_bytes.h"
#include "clients/cpp/status_macros.h"

namespace pepeseg::client {
namespace {

using Rendering = v1::RenderService::Stub;
using Labels = v1::LabelService::Stub;

// Appends the chunks of an export to `file` and returns its header, which comes before them.
// `on_part` gets every message. DATA_LOSS: the whole fails its size or SHA-256.
template <typename Response>
absl::StatusOr<typename Response::Header> Receive(
    grpc::ClientReader<Response>& stream, OutputFile& file,
    absl::FunctionRef<void(const Response&)> on_part) {
  typename Response::Header header;
  Sha256 sha256;
  int64_t size = 0;
  Response part;
  while (stream.Read(&part)) {
    on_part(part);
    if (part.has_header()) header = part.header();
    if (!part.has_chunk()) continue;
    sha256.Add(part.chunk());
    size += static_cast<int64_t>(part.chunk().size());
    RETURN_IF_ERROR(file.Append(part.chunk()));
  }
  RETURN_IF_ERROR(FromGrpc(stream.Finish()));
  if (size != header.num_bytes() || sha256.Finish() != header.sha256()) {
    return absl::DataLossError(
        absl::StrCat("the file does not match its announced size and SHA-256: received ", size,
                     " of ", header.num_bytes(), " bytes"));
  }
  return header;
}

// Exports to `path` with a method of `stub`. A stream that the server puts off has sent nothing, so
// that it can be repeated into the same file; one that has sent bytes is not repeated.
template <typename Stub, typename Request, typename Response>
absl::StatusOr<typename Response::Header> ReceiveAll(
    Stub& stub,
    std::unique_ptr<grpc::ClientReader<Response>> (Stub::*method)(grpc::ClientContext*,
                                                                  const Request&),
    const Request& request, const std::string& path,
    absl::FunctionRef<void(const Response&)> on_part) {
  ASSIGN_OR_RETURN(OutputFile file, OutputFile::Create(path));
  const RetryBudget retries(kCallSeconds);
  while (true) {
    // No deadline: a large export takes as long as it takes.
    Call call(SceneOf(request.model()), 0);
    auto header = Receive<Response>(*(stub.*method)(call, request), file, on_part);
    if (header.ok()) {
      RETURN_IF_ERROR(file.Commit());
      return header;
    }
    call.Cancel();
    if (file.num_bytes() > 0 || !retries.WaitAfter(header.status())) return header.status();
  }
}

}  // namespace

absl::StatusOr<v1::ExportGaussiansResponse::Header> Client::Export(
    const v1::ExportGaussiansRequest& request, const std::string& file) const {
  return ReceiveAll(
      *rendering_, &Rendering::ExportGaussians, request, file,
      absl::FunctionRef<void(const v1::ExportGaussiansResponse&)>([](const auto&) {}));
}

absl::StatusOr<v1::ExportMeshResponse::Header> Client::ExportMesh(
    const v1::ExportMeshRequest& request, const std::string& file) const {
  return ReceiveAll(*rendering_, &Rendering::ExportMesh, request, file,
                    absl::FunctionRef<void(const v1::ExportMeshResponse&)>([](const auto&) {}));
}

absl::StatusOr<v1::ExportAnnotationsResponse::Header> Client::ExportAnnotations(
    const v1::ExportAnnotationsRequest& request, const std::string& file,
    absl::FunctionRef<void(const v1::ExportAnnotationsResponse::Progress&)> on_progress) const {
  const auto on_part = [&](const v1::ExportAnnotationsResponse& part) {
    if (part.has_progress()) on_progress(part.progress());
  };
  return ReceiveAll(*labels_, &Labels::ExportAnnotations, request, file,
                    absl::FunctionRef<void(const v1::ExportAnnotationsResponse&)>(on_part));
}

}  // namespace pepeseg::client
