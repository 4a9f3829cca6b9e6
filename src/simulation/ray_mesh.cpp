#include "fdi_lio/simulation/ray_mesh.hpp"

#include <algorithm>

#include <embree3/rtcore.h>

#include "fdi_lio/common/error.hpp"

namespace fdi_lio::simulation {

namespace {

template <typename T>
T* new_buffer(RTCGeometry geometry, RTCBufferType type, RTCFormat format, std::size_t stride,
              std::size_t count) {
  void* data = rtcSetNewGeometryBuffer(geometry, type, 0, format, stride, count);
  if (data == nullptr) throw Error("Embree could not allocate a world of this size: make the world smaller");
  return static_cast<T*>(data);
}

}  // namespace

struct RayMesh::Impl {
  Mesh mesh;
  RTCDevice device = nullptr;
  RTCScene scene = nullptr;
  double radius = 0.0;

  ~Impl() {
    if (scene != nullptr) rtcReleaseScene(scene);
    if (device != nullptr) rtcReleaseDevice(device);
  }

  Hit make_hit(float range, unsigned triangle_id, float u, float v, const Eigen::Vector3f& normal) const {
    Hit hit;
    hit.range = range;
    hit.normal = normal.normalized();
    const auto& triangle = mesh.triangles[triangle_id];
    hit.uv = (1.0f - u - v) * mesh.uvs[triangle[0]] + u * mesh.uvs[triangle[1]] + v * mesh.uvs[triangle[2]];
    hit.material = mesh.materials[triangle_id];
    return hit;
  }
};

RayMesh::RayMesh(Mesh mesh) : impl_(std::make_unique<Impl>()) {
  impl_->mesh = std::move(mesh);
  impl_->device = rtcNewDevice(nullptr);
  if (impl_->device == nullptr) throw Error("Embree does not start on this processor (it needs SSE2)");
  impl_->scene = rtcNewScene(impl_->device);
  rtcSetSceneFlags(impl_->scene, RTC_SCENE_FLAG_ROBUST);
  const auto& vertices = impl_->mesh.vertices;
  const auto& triangles = impl_->mesh.triangles;
  RTCGeometry geometry = rtcNewGeometry(impl_->device, RTC_GEOMETRY_TYPE_TRIANGLE);
  auto* vertex_data = new_buffer<float>(geometry, RTC_BUFFER_TYPE_VERTEX, RTC_FORMAT_FLOAT3,
                                        3 * sizeof(float), vertices.size());
  auto* index_data = new_buffer<std::uint32_t>(geometry, RTC_BUFFER_TYPE_INDEX, RTC_FORMAT_UINT3,
                                               3 * sizeof(std::uint32_t), triangles.size());
  for (std::size_t i = 0; i < vertices.size(); ++i) {
    for (int k = 0; k < 3; ++k) vertex_data[3 * i + static_cast<std::size_t>(k)] = vertices[i][k];
    impl_->radius = std::max(impl_->radius, static_cast<double>(vertices[i].norm()));
  }
  for (std::size_t i = 0; i < triangles.size(); ++i) std::copy_n(triangles[i].begin(), 3, index_data + 3 * i);
  rtcCommitGeometry(geometry);
  rtcAttachGeometry(impl_->scene, geometry);
  rtcReleaseGeometry(geometry);
  rtcCommitScene(impl_->scene);
}

RayMesh::~RayMesh() = default;
RayMesh::RayMesh(RayMesh&&) noexcept = default;
RayMesh& RayMesh::operator=(RayMesh&&) noexcept = default;

void RayMesh::intersect(const RayPacket& rays, float max_range, Hit* hits) const {
  alignas(64) int valid[kPacketSize];
  RTCRayHit16 packet;
  for (std::size_t i = 0; i < kPacketSize; ++i) {
    const Eigen::Vector3f& direction = rays.directions[i < rays.count ? i : 0];
    valid[i] = i < rays.count ? -1 : 0;
    packet.ray.org_x[i] = rays.origin.x();
    packet.ray.org_y[i] = rays.origin.y();
    packet.ray.org_z[i] = rays.origin.z();
    packet.ray.dir_x[i] = direction.x();
    packet.ray.dir_y[i] = direction.y();
    packet.ray.dir_z[i] = direction.z();
    packet.ray.tnear[i] = 0.0f;
    packet.ray.tfar[i] = max_range;
    packet.ray.time[i] = 0.0f;
    packet.ray.mask[i] = 0xffffffffu;
    packet.ray.flags[i] = 0;
    packet.hit.geomID[i] = RTC_INVALID_GEOMETRY_ID;
  }
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  context.flags = RTC_INTERSECT_CONTEXT_FLAG_COHERENT;
  rtcIntersect16(valid, impl_->scene, &context, &packet);
  for (std::size_t i = 0; i < rays.count; ++i) {
    hits[i] = Hit();
    if (packet.hit.geomID[i] == RTC_INVALID_GEOMETRY_ID) continue;
    const Eigen::Vector3f normal(packet.hit.Ng_x[i], packet.hit.Ng_y[i], packet.hit.Ng_z[i]);
    hits[i] =
        impl_->make_hit(packet.ray.tfar[i], packet.hit.primID[i], packet.hit.u[i], packet.hit.v[i], normal);
  }
}

Hit RayMesh::intersect(const Eigen::Vector3f& origin, const Eigen::Vector3f& direction, float min_range,
                       float max_range) const {
  RTCRayHit query;
  query.ray = {
      origin.x(), origin.y(),  origin.z(), min_range, direction.x(), direction.y(), direction.z(), 0.0f,
      max_range,  0xffffffffu, 0,          0};
  query.hit.geomID = RTC_INVALID_GEOMETRY_ID;
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  rtcIntersect1(impl_->scene, &context, &query);
  if (query.hit.geomID == RTC_INVALID_GEOMETRY_ID) return Hit();
  const Eigen::Vector3f normal(query.hit.Ng_x, query.hit.Ng_y, query.hit.Ng_z);
  return impl_->make_hit(query.ray.tfar, query.hit.primID, query.hit.u, query.hit.v, normal);
}

std::size_t RayMesh::triangle_count() const { return impl_->mesh.triangles.size(); }

double RayMesh::radius() const { return impl_->radius; }

}  // namespace fdi_lio::simulation
