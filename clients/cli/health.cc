// The verb "health": asks the standard service grpc.health.v1, as gateways and orchestrators do.
#include <google/protobuf/wrappers.pb.h>
#include <grpcpp/generic/generic_stub.h>
#include <grpcpp/support/byte_buffer.h>

#include <future>
#include <memory>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "clients/cli/shell.h"
#include "clients/cpp/answer_status.h"
#include "clients/cpp/call.h"
#include "clients/cpp/status_macros.h"

namespace pepeseg::client::cli {
namespace {

constexpr double kAnswerSeconds = 5;  // deadline of the call
constexpr int kServing = 1;           // HealthCheckResponse.ServingStatus.SERVING

// Returns the ServingStatus of a service, or of the whole server for "".
//
// Debian has no stubs of the health service, so the call is generic. On the wire HealthCheckRequest
// is a StringValue and HealthCheckResponse an Int32Value: each has one field, number 1.
absl::StatusOr<int> AskHealth(const Shell& shell, const std::string& service) {
  google::protobuf::StringValue message;
  message.set_value(service);
  const grpc::Slice bytes(message.SerializeAsString());
  const grpc::ByteBuffer request(&bytes, 1);
  grpc::ByteBuffer response;
  Call call("", kAnswerSeconds);
  grpc::GenericStub stub(shell.channel);
  std::promise<grpc::Status> done;
  stub.UnaryCall(call, "/grpc.health.v1.Health/Check", grpc::StubOptions(), &request, &response,
                 [&done](grpc::Status status) { done.set_value(std::move(status)); });
  RETURN_IF_ERROR(FromGrpc(done.get_future().get()));
  grpc::Slice answer;
  google::protobuf::Int32Value status;
  if (!response.DumpToSingleSlice(&answer).ok() ||
      !status.ParseFromArray(answer.begin(), static_cast<int>(answer.size()))) {
    return absl::InternalError("the server's answer is not one of grpc.health.v1");
  }
  return status.value();
}

// `alive`: any answer is a success, whatever its status.
absl::Status RunHealth(const Shell& shell, const std::string& service, bool alive) {
  ASSIGN_OR_RETURN(const int status, AskHealth(shell, service));
  const std::string name = service.empty() ? "the server" : service;
  if (alive) {
    const char* answer = status == kServing ? "true" : "false";
    Print(shell.json ? absl::StrCat(R"({"serving":)", answer, "}")
                     : absl::StrCat(name, " answers"));
    return absl::OkStatus();
  }
  if (status != kServing) {
    return absl::UnavailableError(absl::StrCat(name,
                                               " does not serve: it is shutting down or drained, "
                                               "or something that it depends on has failed"));
  }
  Print(shell.json ? R"({"serving":true})" : absl::StrCat(name, " serves"));
  return absl::OkStatus();
}

}  // namespace

void AddHealth(CLI::App& app, Shell& shell) {
  const auto service = std::make_shared<std::string>();
  CLI::App* verb =
      app.add_subcommand("health", "Check that the server serves; exit code 5 if it does not");
  verb->add_option("SERVICE", *service,
                   "A service, such as pepeseg.v1.JobService; by default the whole server");
  const auto alive = std::make_shared<bool>(false);
  verb->add_flag(
      "--alive", *alive,
      "Check only that the server answers, whether it serves or not; for liveness probes");
  verb->callback([service, alive, &shell] {
    shell.verb = [service, alive, &shell] { return RunHealth(shell, *service, *alive); };
  });
}

}  // namespace pepeseg::client::cli
