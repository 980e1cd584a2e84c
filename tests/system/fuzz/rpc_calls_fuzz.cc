// Calls a running server with any method of the contract: the first byte chooses the method, the
// rest is its request. The server must answer each call, and never with an error of its own.
#include <google/protobuf/descriptor.h>
#include <google/protobuf/message.h>
#include <grpcpp/generic/generic_stub.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <memory>
#include <optional>
#include <random>
#include <set>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "tests/server/running_server.h"
#include "tests/system/fuzz/fuzz_target.h"
#include "tests/system/fuzz/message_mutator.h"

namespace pepeseg::fuzz {
namespace {

using google::protobuf::Message;
using google::protobuf::MethodDescriptor;

constexpr std::chrono::seconds kDeadline{2};

// The order decides which method a first byte stands for; the corpus is made in the same order.
constexpr std::array kServices = {"DatasetService",      "EvaluationService", "JobService",
                                  "LabelService",        "RenderService",     "SceneService",
                                  "SegmentationService", "SelectionService",  "EditService"};

// Methods that would remove what the other calls need.
const std::set<std::string>& LeftOut() {
  static const std::set<std::string> names = {"DeleteScene", "DeleteModel"};
  return names;
}

std::vector<const MethodDescriptor*> FindMethods() {
  std::vector<const MethodDescriptor*> methods;
  for (const char* name : kServices) {
    const auto* service = google::protobuf::DescriptorPool::generated_pool()->FindServiceByName(
        absl::StrCat("pepeseg.v1.", name));
    Expect(service != nullptr, "the services of the contract");
    for (int i = 0; i < service->method_count(); ++i) {
      if (!LeftOut().contains(service->method(i)->name())) methods.push_back(service->method(i));
    }
  }
  return methods;
}

const std::vector<const MethodDescriptor*>& Methods() {
  static const std::vector<const MethodDescriptor*> methods = FindMethods();
  return methods;
}

// Returns the method that the first byte stands for, and its request; null if the rest is not such
// a message, which gRPC itself refuses.
struct Call {
  const MethodDescriptor* method = nullptr;
  std::unique_ptr<Message> request;
};

Call ReadCall(absl::string_view bytes) {
  if (bytes.empty()) return {};
  Call call;
  call.method = Methods()[static_cast<uint8_t>(bytes[0]) % Methods().size()];
  call.request.reset(google::protobuf::MessageFactory::generated_factory()
                         ->GetPrototype(call.method->input_type())
                         ->New());
  if (!call.request->ParseFromArray(bytes.data() + 1, static_cast<int>(bytes.size()) - 1)) {
    call.request.reset();
  }
  return call;
}

// Starts no job, since a training takes minutes.
void OnlyValidate(Message& request) {
  const auto* field = request.GetDescriptor()->FindFieldByName("validate_only");
  if (field != nullptr) request.GetReflection()->SetBool(&request, field, true);
}

// A server with a trained scene.
class ServerToAsk {
 public:
  ServerToAsk() : running_(PEPESEG_MODEL_WORKER), stub_(running_.channel) {
    spdlog::set_level(spdlog::level::off);
    running_.CreateScene("shelf");
    const v1::Job job = running_.Await(running_.Train("shelf", "file").name());
    Expect(job.state() == v1::JOB_STATE_SUCCEEDED, "a model to ask about");
  }

  // Sends the request, and reads the whole answer.
  grpc::Status Ask(const Call& call) {
    grpc::ClientContext context;
    context.set_deadline(std::chrono::system_clock::now() + kDeadline);
    const std::string path =
        absl::StrCat("/", call.method->service()->full_name(), "/", call.method->name());
    grpc::CompletionQueue queue;
    const auto stream = stub_.PrepareCall(&context, path, &queue);
    bool ok = Wait(queue, [&](void* tag) { stream->StartCall(tag); });
    const grpc::Slice slice(call.request->SerializeAsString());
    const grpc::ByteBuffer sent(&slice, 1);
    if (ok) ok = Wait(queue, [&](void* tag) { stream->WriteLast(sent, {}, tag); });
    grpc::ByteBuffer answer;
    while (ok) ok = Wait(queue, [&](void* tag) { stream->Read(&answer, tag); });
    grpc::Status status;
    Wait(queue, [&](void* tag) { stream->Finish(&status, tag); });
    return status;
  }

 private:
  template <class Start>
  static bool Wait(grpc::CompletionQueue& queue, Start start) {
    void* tag = nullptr;
    bool ok = false;
    start(&tag);
    return queue.Next(&tag, &ok) && ok;
  }

  RunningServer running_;
  grpc::GenericStub stub_;
};

bool IsServersOwn(grpc::StatusCode code) {
  return code == grpc::UNKNOWN || code == grpc::INTERNAL || code == grpc::DATA_LOSS;
}

void AskServer(absl::string_view bytes) {
  const Call call = ReadCall(bytes);
  if (call.request == nullptr) return;
  OnlyValidate(*call.request);
  static ServerToAsk server;
  const grpc::Status status = server.Ask(call);
  if (!IsServersOwn(status.error_code())) return;
  const std::string what = absl::StrCat("no error of the server's own from ", call.method->name(),
                                        ": ", status.error_message());
  Expect(false, what.c_str());
}

std::optional<std::string> MutateCall(absl::string_view bytes, std::mt19937& random) {
  const Call call = ReadCall(bytes);
  if (call.request == nullptr) return std::nullopt;
  MutateMessage(*call.request, random);
  return absl::StrCat(bytes.substr(0, 1), call.request->SerializePartialAsString());
}

}  // namespace
}  // namespace pepeseg::fuzz

PEPESEG_FUZZ_MUTATOR(rpc_calls, &pepeseg::fuzz::MutateCall)
PEPESEG_FUZZ_TARGET(rpc_calls) { pepeseg::fuzz::AskServer(bytes); }
