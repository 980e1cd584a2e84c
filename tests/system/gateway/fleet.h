#pragma once

#include <grpcpp/grpcpp.h>

#include <filesystem>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "core/base/file_bytes.h"
#include "pepeseg/v1/access.pb.h"
#include "server/jobs/process.h"
#include "tests/server/access/test_certificates.h"
#include "tests/server/pepesegd_process.h"
#include "tests/system/gateway/token_issuer.h"
#include "tests/testing/temp_folder.h"

namespace pepeseg::testing {

inline constexpr char kHaproxy[] = "/usr/sbin/haproxy";

// One that nothing listens on now.
int FreePort();

// Whether this machine has what deploy/gateway/haproxy.cfg needs.
bool HasHaproxy();

struct FleetOptions {
  int num_servers = 1;
  std::string database;                          // Store::Open's; empty: SQLite, for one server
  std::filesystem::path data;                    // empty: in the fleet's own folder
  std::filesystem::path worker;                  // empty: pepeseg-worker
  std::vector<std::string> server_arguments;     // beside the usual ones
  std::vector<std::string> gateway_environment;  // before what the fleet gives: "NAME=VALUE"
};

// The real HAProxy with deploy/gateway/haproxy.cfg, and servers behind it that trust its
// certificate; all on ports of this machine, and killed with the object.
class Fleet {
 public:
  explicit Fleet(const FleetOptions& options);

  // Server `i`, from 0; it keeps its port.
  void StartServer(int i);
  std::optional<WorkerEnd> StopServer(int i);  // SIGTERM, and how it ended
  void KillServer(int i) { servers_[i].reset(); }
  PepesegdProcess& server(int i) { return *servers_[i]; }
  // Ends the gateway and starts it with so many servers.
  void RestartGateway(int num_servers);
  WorkerProcess& gateway() { return *gateway_; }
  int gateway_port() const { return gateway_port_; }
  // Until the gateway sees so many servers serve, 20 s at most.
  bool AwaitServing(int num_servers) const;
  int CountServing() const;
  std::string Metrics() const;

  // A connection of its own to the gateway, or past it to server `i`. `token`: a key or a JWT, sent
  // with each call; empty: none.
  std::shared_ptr<grpc::Channel> Connect(const std::string& token) const;
  std::shared_ptr<grpc::Channel> ConnectDirectly(int i, const std::string& token) const;
  // The same with another certificate than the gateway's.
  std::shared_ptr<grpc::Channel> ConnectDirectly(int i, const std::string& token,
                                                 const IssuedCertificate& own) const;
  // A secret of the servers' own.
  std::string MakeKey(const std::string& project, const std::vector<v1::Scope>& scopes) const;

  // The log of the gateway since its start, from `offset` on, a line an object; what else it says
  // is left out.
  std::vector<nlohmann::json> ReadLog(size_t offset = 0) const;
  size_t LogSize() const;
  std::string LogTail() const { return ReadFileTail(log_, 3000); }
  std::string ReadAudit() const;

  const TokenIssuer issuer, next_issuer;  // both are trusted
  TestAuthority authority{"authority"}, clients{"of clients"};
  const TempFolder folder;

 private:
  void WriteFiles();
  std::string Database() const;

  const FleetOptions options_;
  const std::filesystem::path data_;
  int num_starts_ = 0;
  std::filesystem::path log_;  // of the gateway that runs
  IssuedCertificate of_gateway_;
  std::vector<int> ports_;
  std::vector<std::unique_ptr<PepesegdProcess>> servers_;
  std::unique_ptr<WorkerProcess> gateway_;
  int gateway_port_ = 0, metrics_port_ = 0;
};

}  // namespace pepeseg::testing
