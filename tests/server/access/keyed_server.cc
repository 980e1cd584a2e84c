#include "tests/server/access/keyed_server.h"

#include <grpcpp/generic/generic_stub.h>

#include <algorithm>
#include <chrono>
#include <fstream>
#include <iterator>

#include "absl/strings/str_cat.h"
#include "server/store/layout.h"

namespace pepeseg {
namespace {

// Runs one operation after the other on a stream.
class Steps {
 public:
  void* tag() { return this; }
  bool Wait() {
    void* tag = nullptr;
    bool ok = false;
    return queue.Next(&tag, &ok) && ok;
  }
  grpc::CompletionQueue queue;
};

grpc::ByteBuffer Serialize(const google::protobuf::Message& message) {
  const grpc::Slice slice(message.SerializeAsString());
  return grpc::ByteBuffer(&slice, 1);
}

}  // namespace

KeyedServer::KeyedServer() : ServiceTest(PEPESEG_MODEL_WORKER, WithAdmin()) {
  running.CreateScene("shelf");
  job = TrainToTheEnd("shelf", "file").name();
  const std::vector<v1::Scope> of_project = {v1::SCOPE_READ, v1::SCOPE_WRITE, v1::SCOPE_TRAIN};
  stranger = MakeKey("other", of_project);
  reader = MakeKey("default", {v1::SCOPE_READ});
  full = MakeKey("default", of_project);
  operates = MakeKey("default", {v1::SCOPE_OPERATE});
  running.options.access.require_keys = true;
  running.Restart();
}

std::string KeyedServer::MakeKey(const std::string& project, const std::vector<v1::Scope>& scopes) {
  v1::CreateKeyRequest request;
  request.set_project(project);
  for (const v1::Scope scope : scopes) request.add_scopes(scope);
  return CallAs(operates, &AdminStub::CreateKey, request)->secret();
}

std::unique_ptr<grpc::ClientContext> KeyedServer::With(const std::string& secret) {
  auto context = std::make_unique<grpc::ClientContext>();
  if (!secret.empty()) context->AddMetadata("authorization", absl::StrCat("Bearer ", secret));
  context->set_deadline(std::chrono::system_clock::now() + std::chrono::seconds(60));
  return context;
}

grpc::Status KeyedServer::Ask(const std::string& method,
                              const std::vector<const google::protobuf::Message*>& messages,
                              const std::string& secret) {
  const bool is_admin = method.find(".AdminService.") != std::string::npos;
  grpc::GenericStub stub(is_admin ? running.server->InProcessAdminChannel() : running.channel);
  std::string path = absl::StrCat("/", method);
  std::replace(path.begin() + static_cast<int64_t>(path.rfind('.')), path.end(), '.', '/');
  const auto context = With(secret);
  Steps steps;
  const auto call = stub.PrepareCall(context.get(), path, &steps.queue);
  call->StartCall(steps.tag());
  bool open = steps.Wait();
  for (size_t i = 0; open && i < messages.size(); ++i) {
    call->Write(Serialize(*messages[i]), steps.tag());
    open = steps.Wait();
  }
  call->WritesDone(steps.tag());
  steps.Wait();
  grpc::ByteBuffer answer;
  do {
    call->Read(&answer, steps.tag());
  } while (steps.Wait());
  grpc::Status status;
  call->Finish(&status, steps.tag());
  steps.Wait();
  return status;
}

std::string KeyedServer::ReadAudit() const {
  std::ifstream file(AuditPath(running.options.data));
  return {std::istreambuf_iterator<char>(file), {}};
}

std::string KeyedServer::ReadRefusals() const {
  std::ifstream file(RefusalPath(running.options.data));
  return {std::istreambuf_iterator<char>(file), {}};
}

}  // namespace pepeseg
