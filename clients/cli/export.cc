// The verb that fetches a model as a PLY for splat viewers.
#include <filesystem>
#include <fstream>
#include <memory>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "clients/cli/checksums.h"
#include "clients/cli/connection.h"
#include "clients/cli/failure.h"
#include "clients/cli/shell.h"
#include "clients/cli/status_macros.h"

namespace pepeseg::cli {
namespace {

namespace fs = std::filesystem;

struct ExportFlags {
  std::string scene;
  std::string file;
  std::string model = "live";
};

using Header = v1::ExportSelectionResponse::Header;

// Checks each chunk and the whole; the header is the stream's first message.
absl::StatusOr<Header> Receive(grpc::ClientReader<v1::ExportSelectionResponse>& stream,
                               std::ofstream& file) {
  Header header;
  Sha256 sha256;
  int64_t size = 0;
  v1::ExportSelectionResponse part;
  while (stream.Read(&part)) {
    if (part.has_header()) header = part.header();
    if (!part.has_chunk()) continue;
    const std::string& data = part.chunk().data();
    if (Crc32c(data) != part.chunk().crc32c()) {
      return absl::DataLossError(absl::StrCat("bytes ", size, " to ", size + data.size(),
                                              " of the PLY fail their checksum"));
    }
    sha256.Add(data);
    size += static_cast<int64_t>(data.size());
    file.write(data.data(), static_cast<std::streamsize>(data.size()));
  }
  RETURN_IF_ERROR(FromGrpc(stream.Finish()));
  file.close();
  if (!file) return absl::PermissionDeniedError("cannot write the PLY: is the disk full?");
  if (size != header.num_bytes() || sha256.Finish() != header.sha256()) {
    return absl::DataLossError(absl::StrCat("the PLY is not what was announced: ", size, " of ",
                                            header.num_bytes(), " bytes"));
  }
  return header;
}

absl::Status RunExport(const Shell& shell, const ExportFlags& flags) {
  const Connection connection(shell.server);
  v1::ExportSelectionRequest request;
  request.set_model(absl::StrCat(SceneName(flags.scene), "/models/", flags.model));
  const fs::path beside = flags.file + ".part";
  std::ofstream file(beside, std::ios::binary | std::ios::trunc);
  if (!file) return absl::PermissionDeniedError(absl::StrCat("cannot write ", beside.string()));
  Call call(SceneName(flags.scene), 0);
  const auto stream = connection.segmentation->ExportSelection(call, request);
  const absl::StatusOr<Header> header = Receive(*stream, file);
  std::error_code error;
  if (!header.ok()) {
    static_cast<grpc::ClientContext*>(call)->TryCancel();
    fs::remove(beside, error);
    return header.status();
  }
  fs::rename(beside, flags.file, error);
  if (error) {
    return absl::PermissionDeniedError(
        absl::StrCat("cannot write ", flags.file, ": ", error.message()));
  }
  if (shell.json) {
    PrintJson(*header);
  } else {
    Print(absl::StrFormat("%s: %d Gaussians, %.1f MB, of %s", flags.file, header->num_gaussians(),
                          static_cast<double>(header->num_bytes()) * 1e-6, header->model()));
  }
  return absl::OkStatus();
}

}  // namespace

void AddExport(CLI::App& app, Shell& shell) {
  auto flags = std::make_shared<ExportFlags>();
  CLI::App* verb = app.add_subcommand("export", "Fetch a model as a PLY, for splat viewers");
  verb->add_option("SCENE", flags->scene, "Id of the scene")->required();
  verb->add_option("FILE", flags->file, "Where to write it")->required();
  verb->add_option("--model", flags->model, "Number of the model")->capture_default_str();
  verb->callback([flags, &shell] { shell.verb = [&, flags] { return RunExport(shell, *flags); }; });
}

}  // namespace pepeseg::cli
