#include "server/server.h"

#include <grpcpp/grpcpp.h>
#include <grpcpp/health_check_service_interface.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <initializer_list>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "core/base/status_macros.h"
#include "core/evaluate/evaluate.h"
#include "server/access/audit_log.h"
#include "server/access/authorizer.h"
#include "server/access/credentials.h"
#include "server/access/project_quotas.h"
#include "server/admin_listener.h"
#include "server/api/error.h"
#include "server/collect/collector.h"
#include "server/data/blob_checker.h"
#include "server/data/data_identity.h"
#include "server/data/locked_file.h"
#include "server/observe/self_probe.h"
#include "server/rpc/call_interceptor.h"
#include "server/rpc/connection_acceptor.h"
#include "server/rpc/listener_probe.h"
#include "server/rpc/reflection.h"
#include "server/server_metrics.h"
#include "server/server_parts.h"
#include "server/services/dataset_service.h"
#include "server/services/detector_words.h"
#include "server/services/edit_service.h"
#include "server/services/evaluation_service.h"
#include "server/services/job_service.h"
#include "server/services/job_snapshots.h"
#include "server/services/label_service.h"
#include "server/services/label_words.h"
#include "server/services/render_service.h"
#include "server/services/scene_service.h"
#include "server/services/segmentation_service.h"
#include "server/services/selection_service.h"
#include "server/services/text_command.h"
#include "server/services/view_images.h"
#include "server/services/word_photographs.h"
#include "server/store/layout.h"
#include "server/worker_protocol/device.h"

namespace pepeseg {
namespace {

constexpr int kMaxRequestBytes = 8 << 20;
// Threads and queues of the pools; README.md says what runs on each.
constexpr int kNumIoThreads = 4;
constexpr int kNumUploadThreads = 4;
// Queries share the lock of their device; what an answer takes of the host besides it is as long.
constexpr int kLeastQueryThreads = 2, kMostQueryThreads = 8;
constexpr int kNumEvaluationThreads = 1;
constexpr int kNumCorrectionThreads = 1;
constexpr int kNumFindThreads = 2;  // a text command may occupy one for two minutes
constexpr int kNumBorderThreads = 1;
constexpr int kNumAdminThreads = 2;  // loading a model occupies one of them for seconds
constexpr int kNumPhotographProcesses = 4;
constexpr size_t kMaxQueuedCalls = 1000;
constexpr size_t kMaxQueuedUploads = 64;  // calls of up to 8 MiB; parts of streams do not count
constexpr size_t kMaxQueuedQueries = 200;
constexpr size_t kMaxQueuedEvaluations = 16;  // each holds its request of up to 8 MiB
constexpr size_t kMaxQueuedCorrections = 16;  // each holds its request of up to 8 MiB
constexpr size_t kMaxQueuedFinds = 16;
constexpr size_t kMaxQueuedBorders = 60;  // a minute of work a project, where each is of a new view
constexpr size_t kMaxQueuedAdminCalls = 100;
constexpr size_t kMaxQueuedPhotographs = 500;
// A project may take half of a pool's queue, so that others find a place in it.
int NumQueryThreads() { return std::clamp(NumCores() / 2, kLeastQueryThreads, kMostQueryThreads); }

WorkerPool::Limits PoolLimits(int threads, size_t queued) {
  return {.threads = threads, .queued = queued, .queued_of_owner = queued / 2};
}
// A decoder may take ten seconds for a photograph, so a project may take half of them only.
constexpr WorkerPool::Limits kPhotographLimits = {.threads = kNumPhotographProcesses,
                                                  .queued = kMaxQueuedPhotographs,
                                                  .threads_of_owner = kNumPhotographProcesses / 2,
                                                  .queued_of_owner = kMaxQueuedPhotographs / 2};
constexpr absl::Duration kTick = absl::Seconds(2);

bool IsEndOfJob(const v1::JobEvent& event) {
  const v1::JobState state = event.state_changed().state();
  return state == v1::JOB_STATE_SUCCEEDED || state == v1::JOB_STATE_FAILED ||
         state == v1::JOB_STATE_CANCELLED;
}

// Time for idle clients to see that the server closes their connections.
constexpr absl::Duration kGoAway = absl::Milliseconds(200);

}  // namespace

// The parts of a server, each after those that it uses: members are destroyed in reverse order.
struct Server::Parts {
  std::unique_ptr<DirectoryLock> lock;
  std::optional<LockedFile> database_lock;
  std::unique_ptr<Store> store;
  std::unique_ptr<AuditLog> audit;
  std::unique_ptr<RefusalLog> refusals;
  std::unique_ptr<Authorizer> authorizer;
  std::unique_ptr<ProjectQuotas> quotas;
  std::unique_ptr<ListenerCredentials> credentials;
  std::unique_ptr<BlobStore> blobs;
  std::unique_ptr<BlobChecker> checker;
  std::unique_ptr<Collector> collector;
  std::vector<Device> devices;  // compute queries; a worker opens its own by the same id
  std::unique_ptr<ModelLoader> models;
  std::unique_ptr<JobSnapshots> snapshots;
  ServerMetrics metrics;
  std::filesystem::path sam, detector;     // folders of their files; empty: none
  TextTask text_task;                      // without a program: there is no text command
  std::shared_ptr<const WordNet> wordnet;  // null: none
  v1::ServerStatus::FindSources find_sources;
  std::unique_ptr<Supervisor> supervisor;
  std::unique_ptr<StreamRegistry> streams;
  WorkerPools pools{WorkerPool(PoolLimits(kNumIoThreads, kMaxQueuedCalls)),
                    WorkerPool(PoolLimits(kNumUploadThreads, kMaxQueuedUploads)),
                    WorkerPool(PoolLimits(NumQueryThreads(), kMaxQueuedQueries)),
                    WorkerPool(PoolLimits(kNumEvaluationThreads, kMaxQueuedEvaluations)),
                    WorkerPool(PoolLimits(kNumCorrectionThreads, kMaxQueuedCorrections)),
                    WorkerPool(PoolLimits(kNumFindThreads, kMaxQueuedFinds)),
                    WorkerPool(PoolLimits(kNumBorderThreads, kMaxQueuedBorders)),
                    WorkerPool({.threads = kNumAdminThreads, .queued = kMaxQueuedAdminCalls})};
  FailedPhotographs failed_photographs;
  PhotographProcess photographs;
  WorkerPool photograph_pool{kPhotographLimits};
  std::unique_ptr<CallRunner> runner;
  std::unique_ptr<HealthMonitor> health;
  std::unique_ptr<Operations> operations;
  std::unique_ptr<SceneServiceRpc> scenes;
  std::unique_ptr<DatasetServiceRpc> datasets;
  std::unique_ptr<JobServiceRpc> jobs;
  std::unique_ptr<ViewImages> images;
  std::unique_ptr<WordPhotographs> word_photographs;
  std::unique_ptr<DetectorWords> detector_words;
  std::unique_ptr<TextCommand> text_command;
  std::unique_ptr<LabelWords> label_words;
  SeenModels seen;
  std::unique_ptr<FindAnswers> finds;
  std::unique_ptr<SegmentationServiceRpc> segmentation;
  std::unique_ptr<LabelServiceRpc> labels;
  std::unique_ptr<Selections> selected;
  std::unique_ptr<SelectionServiceRpc> selections;
  std::unique_ptr<EditServiceRpc> edits;
  std::unique_ptr<RenderServiceRpc> renders;
  std::unique_ptr<EvaluationServiceRpc> evaluations;
  std::unique_ptr<AdminListener> admin;
  std::unique_ptr<ConnectionAcceptor> acceptor;
  std::unique_ptr<grpc::Server> server;
  std::unique_ptr<SelfProbe> self_probe;
  absl::Duration drain;

  // Called once each, in this order (OpenAccess by OpenStorage). Start() destroys the parts at the
  // first error. Locks the data directory, and opens the database and the stored files.
  absl::Status OpenStorage(const ServerOptions& options);
  // Opens certificates, the audit log and keys.
  absl::Status OpenAccess(const ServerOptions& options);
  // Opens the devices, and makes the caches of models.
  absl::Status OpenCompute(const ServerOptions& options);
  // Starts the supervisor, which may start workers at once.
  absl::Status StartJobs(const ServerOptions& options);
  // Makes the services, and opens the listeners of operators: admin calls and metrics.
  absl::Status MakeServices(const ServerOptions& options);
  void MakeQueryServices(int num_threads);
  // Opens the listener of clients. From then on calls are answered.
  absl::Status Listen(const ServerOptions& options);
  void StartSelfProbe(const ServerOptions& options);
};

absl::Status Server::Parts::OpenAccess(const ServerOptions& options) {
  ASSIGN_OR_RETURN(credentials, ListenerCredentials::Open(options.access));
  ASSIGN_OR_RETURN(audit, AuditLog::Open(AuditPath(options.data), {}));
  ASSIGN_OR_RETURN(refusals, RefusalLog::Open(RefusalPath(options.data), {}));
  authorizer =
      std::make_unique<Authorizer>(store.get(), audit.get(), refusals.get(),
                                   options.access.require_keys, options.access.trusted_gateway);
  return absl::OkStatus();
}

absl::Status Server::Parts::OpenStorage(const ServerOptions& options) {
  ASSIGN_OR_RETURN(lock, DirectoryLock::Take(options.data, IsShared(options)));
  ASSIGN_OR_RETURN(database_lock, LockDatabase(options));
  ASSIGN_OR_RETURN(store, OpenStore(options));
  RETURN_IF_ERROR(CheckIdentity(*store, options.data));
  RETURN_IF_ERROR(OpenAccess(options));
  store->SetDefaultQuota(options.quota);
  quotas = std::make_unique<ProjectQuotas>(store.get());
  ASSIGN_OR_RETURN(blobs, BlobStore::Open(options.data));
  checker = std::make_unique<BlobChecker>(*blobs, *store);
  CollectorOptions collection;
  collection.data = options.data;
  collection.alone = !IsShared(options);
  collector = std::make_unique<Collector>(*store, std::move(collection));
  return absl::OkStatus();
}

absl::Status Server::Parts::OpenCompute(const ServerOptions& options) {
  // Weights that cannot be read are refused now, and not by the first job.
  if (const std::filesystem::path& weights = options.workers.lpips_weights; !weights.empty()) {
    RETURN_IF_ERROR(CheckLpips(weights));
  }
  ASSIGN_OR_RETURN(devices, OpenDevices(options.devices, options.num_threads));
  LogDevices(options, devices);
  models = std::make_unique<ModelLoader>(ModelLoader::Dependencies{options.data, *store, *quotas},
                                         MakeModelDevices(options, devices));
  snapshots = std::make_unique<JobSnapshots>(*models, ScratchFolder(options.data));
  return absl::OkStatus();
}

absl::Status Server::Parts::StartJobs(const ServerOptions& options) {
  SupervisorOptions job_options = JobOptions(options, devices);
  ASSIGN_OR_RETURN(sam, FindSam(options));
  job_options.workers.sam = sam;
  ASSIGN_OR_RETURN(const std::filesystem::path command,
                   FindCommand("priors command", options.workers.priors_command));
  job_options.workers.priors_command = command.string();
  ASSIGN_OR_RETURN(detector, FindDetector(options));
  ASSIGN_OR_RETURN(text_task, FindTextCommand(options, devices.size()));
  job_options.file_path = [of = blobs.get()](const std::string& project,
                                             const DatasetFileRecord& file) {
    return of->Path({project, file.sha256});
  };
  job_options.check_files = [of = checker.get()](const std::string& project,
                                                 std::vector<DatasetFileRecord> files) {
    return of->Check(project, std::move(files));
  };
  job_options.on_event = [this](const std::string& job, const v1::JobEvent& event) {
    metrics.jobs().Observe(job, event);
    // Its model answers from now on.
    if (IsEndOfJob(event)) snapshots->Forget(job);
  };
  ASSIGN_OR_RETURN(supervisor, Supervisor::Start(*store, std::move(job_options)));
  return absl::OkStatus();
}

absl::Status Server::Parts::MakeServices(const ServerOptions& options) {
  photographs.worker = options.worker;
  photographs.sandbox = options.workers.sandbox;
  photographs.scratch = ScratchFolder(options.data);
  photographs.failed = &failed_photographs;
  runner = std::make_unique<CallRunner>(*authorizer, *quotas, *streams, pools);
  health = MakeHealthMonitor(*store, devices, options.data);
  operations = std::make_unique<Operations>(
      Operations::Dependencies{*runner, *models, *supervisor, *health, find_sources});
  EstimateTools tools;
  tools.has_priors_command = !options.workers.priors_command.empty();
  tools.has_sam = !sam.empty();
  tools.has_lpips = !options.workers.lpips_weights.empty();
  const int num_threads = ThreadsOfDevice(options.num_threads, static_cast<int>(devices.size()));
  tools.num_threads = num_threads > 0 ? num_threads : NumCores();
  scenes = std::make_unique<SceneServiceRpc>(*runner, *models, *snapshots, *blobs);
  datasets = std::make_unique<DatasetServiceRpc>(
      *runner, *models, *blobs,
      DatasetServiceRpc::Dependencies{tools.has_priors_command || tools.has_sam,
                                      {&photograph_pool, &photographs, checker.get()}});
  const TrainingDevice smallest = SmallestDevice(options, devices);
  tools.device_memory = smallest.memory_bytes;
  jobs = std::make_unique<JobServiceRpc>(
      *runner, JobServiceRpc::Dependencies{*store, *blobs, *supervisor, {smallest.backend, tools}});
  ASSIGN_OR_RETURN(wordnet, FindWordNet(options));
  MakeQueryServices(tools.num_threads);
  if (!options.admin.empty()) {
    ASSIGN_OR_RETURN(admin, AdminListener::Start({options.admin, credentials->Make()}, *operations,
                                                 metrics.rpc()));
  }
  return options.metrics.empty() ? absl::OkStatus() : metrics.Expose(options.metrics, *operations);
}

void Server::Parts::MakeQueryServices(int num_threads) {
  images = std::make_unique<ViewImages>(ViewImages::Dependencies{
      sam, num_threads, CudaDevice(devices.front().id), *store, *models, *blobs, photographs});
  word_photographs =
      std::make_unique<WordPhotographs>(WordPhotographs::Dependencies{*store, *blobs, photographs});
  detector_words = std::make_unique<DetectorWords>(
      DetectorWords::Dependencies{detector, num_threads, *models, *word_photographs});
  text_command = std::make_unique<TextCommand>(TextCommand::Dependencies{
      text_task, photographs.worker, photographs.scratch, *word_photographs});
  label_words = std::make_unique<LabelWords>(*store, wordnet);
  find_sources.set_synonyms(wordnet != nullptr);
  find_sources.set_num_detector_words(static_cast<int>(detector_words->num_words()));
  find_sources.set_text_command(!text_task.program.empty());
  find_sources.set_appearance(!sam.empty());
  // In the order in which they are asked.
  const std::vector<WordSource*> words = {label_words.get(), detector_words.get(),
                                          text_command.get()};
  finds = std::make_unique<FindAnswers>(*models, *images, seen, words);
  segmentation =
      std::make_unique<SegmentationServiceRpc>(*runner, *models, *snapshots, *images, *finds);
  labels = std::make_unique<LabelServiceRpc>(*runner, *models, *snapshots, *images);
  selected = std::make_unique<Selections>(*store, models->data_folder());
  selections = std::make_unique<SelectionServiceRpc>(*runner, *models, *images, *selected);
  edits =
      std::make_unique<EditServiceRpc>(EditModelStream::Dependencies{*runner, *models, *selected});
  renders = std::make_unique<RenderServiceRpc>(*runner, *models, *snapshots, *selected);
  evaluations = std::make_unique<EvaluationServiceRpc>(*runner, *models, *blobs, photographs);
}

absl::Status Server::Parts::Listen(const ServerOptions& options) {
  // A global setting of gRPC, which counts for servers that are built afterwards: not for the admin
  // listener.
  grpc::EnableDefaultHealthCheckService(true);
  grpc::ServerBuilder builder;
  SetReflection(builder, options.reflection);
  SetLimits(builder, {kMaxRequestBytes, options.max_connection_age});
  std::vector<std::unique_ptr<grpc::experimental::ServerInterceptorFactoryInterface>> interceptors;
  interceptors.push_back(MakeCallInterceptors(
      metrics.rpc(), options.data, [this](const grpc::ServerContextBase& context) {
        return ToGrpc(authorizer->AuthorizeReflection(OriginOf(context)));
      }));
  builder.experimental().SetInterceptorCreators(std::move(interceptors));
  ASSIGN_OR_RETURN(acceptor,
                   ConnectionAcceptor::Listen(options.listen, credentials->Make(), builder));
  const std::initializer_list<grpc::Service*> services = {
      scenes.get(),     datasets.get(), jobs.get(),    segmentation.get(), labels.get(),
      selections.get(), edits.get(),    renders.get(), evaluations.get()};
  for (grpc::Service* service : services) builder.RegisterService(service);
  server = builder.BuildAndStart();
  if (server == nullptr) {
    return absl::UnavailableError(absl::StrCat("cannot serve on ", options.listen));
  }
  // The listener was bound above, but no connection is accepted before the services can answer.
  acceptor->Start();
  health->Start([service = server->GetHealthCheckService()](const std::string& name, bool serving) {
    name.empty() ? service->SetServingStatus(serving) : service->SetServingStatus(name, serving);
  });
  collector->Start();
  if (options.self_probe > absl::ZeroDuration()) StartSelfProbe(options);
  return absl::OkStatus();
}

void Server::Parts::StartSelfProbe(const ServerOptions& options) {
  ListenerProbeOptions probe;
  probe.listening = acceptor->descriptor();
  probe.on_address = [this](const std::string& address) { acceptor->SetProbe(address); };
  SelfProbe::Pace pace;
  pace.interval = options.self_probe;
  self_probe = std::make_unique<SelfProbe>(
      [probe = std::move(probe)] { return ProbeListener(probe); }, pace,
      [this, on_unreachable = options.on_unreachable](const absl::Status& why) {
        spdlog::critical("the server does not answer new connections ({}): it must be restarted",
                         std::string(why.message()));
        health->SetDraining(true);
        if (on_unreachable) on_unreachable();
      });
}

absl::StatusOr<std::unique_ptr<Server>> Server::Start(const ServerOptions& options) {
  RETURN_IF_ERROR(CheckOptions(options));
  auto parts = std::make_unique<Parts>();
  parts->streams = std::make_unique<StreamRegistry>(kTick, options.streams);
  RETURN_IF_ERROR(parts->OpenStorage(options));
  RETURN_IF_ERROR(parts->OpenCompute(options));
  RETURN_IF_ERROR(parts->StartJobs(options));
  RETURN_IF_ERROR(parts->MakeServices(options));
  RETURN_IF_ERROR(parts->Listen(options));
  parts->drain = options.drain;
  return std::unique_ptr<Server>(new Server(std::move(parts)));
}

Server::Server(std::unique_ptr<Parts> parts) : parts_(std::move(parts)) {}

Server::~Server() { Shutdown(absl::Now()); }

int Server::port() const { return parts_->acceptor->port(); }

int Server::admin_port() const { return parts_->admin == nullptr ? 0 : parts_->admin->port(); }

int Server::metrics_port() const { return parts_->metrics.port(); }

std::shared_ptr<grpc::Channel> Server::InProcessChannel() {
  return parts_->server->InProcessChannel(grpc::ChannelArguments());
}

std::shared_ptr<grpc::Channel> Server::InProcessAdminChannel() {
  return parts_->admin == nullptr ? nullptr : parts_->admin->InProcessChannel();
}

void Server::Shutdown(absl::Time deadline) {
  if (parts_->server == nullptr) return;
  parts_->self_probe.reset();
  parts_->health->SetDraining(true);
  // Calls are still answered for `drain`: a gateway may not have seen NOT_SERVING yet.
  const absl::Duration left = std::max(deadline - absl::Now(), absl::ZeroDuration());
  absl::SleepFor(std::min(parts_->drain, left));
  parts_->operations->SetDraining(true);
  parts_->streams->EndAll(DrainingError());
  parts_->supervisor->Stop(deadline);
  // Waits for calls here, and gives gRPC a short deadline below: it would wait until its deadline
  // for a client that keeps an idle connection and does not read from it.
  while (parts_->metrics.rpc().num_named_in_flight() > 0 && absl::Now() < deadline) {
    absl::SleepFor(absl::Milliseconds(5));
  }
  parts_->acceptor->Stop();
  parts_->server->Shutdown(absl::ToChronoTime(std::min(deadline, absl::Now() + kGoAway)));
  parts_->server->Wait();
  if (parts_->admin != nullptr) parts_->admin->Shutdown(deadline);
  parts_->metrics.Stop();
  parts_->health->Stop();
  // No call is left, so no task in the pools has anything to answer.
  parts_->pools.Stop();
  parts_->photograph_pool.Stop();
  parts_->collector->Stop();
  parts_->server.reset();
}

}  // namespace pepeseg
