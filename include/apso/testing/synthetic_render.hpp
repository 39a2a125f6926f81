/// \file
/// Draws the synthetic room: which surface each pixel sees (exact depth), then its colour.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include <apso/config.hpp>
#include <apso/math/se3.hpp>
#include <apso/testing/synthetic_limb.hpp>
#include <apso/testing/synthetic_scene.hpp>
#include <apso/testing/synthetic_texture.hpp>
#include <apso/testing/synthetic_walker.hpp>
#include <apso/types/image_view.hpp>
#include <apso/types/pinhole.hpp>

APSO_NAMESPACE_BEGIN
namespace testing {

/// The images to draw into. `surface` is the index of a face, or the number of faces plus the index of a limb.
struct Canvas3d {
  Image<float> inverse_depth;    ///< [1/m], 0 where nothing is seen
  Image<std::uint16_t> surface;  ///< see above
  Image<Lanes> colour;           ///< 0 where nothing is seen
};

/// Draws faces and limbs by casting one ray through each pixel they may cover.
class Renderer {
 public:
  Renderer(const Scene& scene, const Pinhole& camera, const Pose& T_world_camera, const std::vector<Limb>& limbs)
      : scene_(scene),
        camera_(camera),
        rotation_(T_world_camera.linear().cast<float>()),
        origin_(T_world_camera.translation().cast<float>()),
        T_camera_world_(inverse(T_world_camera)),
        ifx_(static_cast<float>(1 / camera.fx)),
        ify_(static_cast<float>(1 / camera.fy)),
        cx_(static_cast<float>(camera.cx)),
        cy_(static_cast<float>(camera.cy)) {
    for (const Limb& limb : limbs) limbs_.push_back(limb_body(limb, camera, T_camera_world_));
  }

  void draw(Canvas3d& out) const {
    out.inverse_depth.assign(camera_.width, camera_.height, 0.0F);
    out.surface.assign(camera_.width, camera_.height, 0);
    out.colour.resize(camera_.width, camera_.height);
    for (std::size_t i = 0; i < scene_.faces.size(); ++i) draw_face(i, out);
    for (std::size_t i = 0; i < limbs_.size(); ++i) draw_limb(i, out);
    for (int y = 0; y < camera_.height; ++y) shade_row(y, out);
  }

  /// Normal of the surface a pixel sees, times the ray direction: the cosine of the angle of incidence.
  [[nodiscard]] float incidence(int x, int y, float depth, std::uint16_t surface) const {
    const Eigen::Vector3f d = ray(x, y);
    if (surface < scene_.faces.size()) return std::abs(d[scene_.faces[surface].axis]) / d.norm();
    const LimbBody& b = limbs_[surface - scene_.faces.size()];
    const Eigen::Vector3f n = b.to_world_normal * body_normal(b, b.to_local * (origin_ + depth * d - b.centre));
    return std::abs(n.dot(d)) / (n.norm() * d.norm());
  }

 private:
  [[nodiscard]] Eigen::Vector3f ray(int x, int y) const {
    return rotation_ * Eigen::Vector3f((static_cast<float>(x) - cx_) * ifx_, (static_cast<float>(y) - cy_) * ify_, 1.0F);
  }

  void draw_face(std::size_t index, Canvas3d& out) const {
    const Face& f = scene_.faces[index];
    const float num = f.offset - origin_[f.axis];
    if (num * static_cast<float>(f.side) >= 0) return;  // seen from behind
    // corners in order around the rectangle, then cut at the near plane
    const auto a1 = static_cast<std::size_t>((f.axis + 1) % 3);
    const auto a2 = static_cast<std::size_t>((f.axis + 2) % 3);
    std::array<Eigen::Vector3d, 4> corner;
    for (std::size_t i = 0; i < 4; ++i) {
      std::array<float, 3> p = f.low;
      if (i == 1 || i == 2) p[a1] = f.high[a1];
      if (i >= 2) p[a2] = f.high[a2];
      corner[i] = T_camera_world_ * Eigen::Vector3d(p[0], p[1], p[2]);
    }
    std::array<Eigen::Vector2d, 8> polygon;
    std::size_t n = 0;
    for (std::size_t i = 0; i < 4; ++i) {
      const Eigen::Vector3d& p = corner[i];
      const Eigen::Vector3d& q = corner[(i + 1) % 4];
      const double near = kNear;
      if (p.z() >= near) polygon[n++] = camera_.project(p);
      if ((p.z() >= near) != (q.z() >= near)) {
        const double s = (near - p.z()) / (q.z() - p.z());
        const Eigen::Vector3d cut = p + s * (q - p);
        polygon[n++] = camera_.project(cut);
      }
    }
    if (n < 3) return;
    double top = polygon[0].y();
    double bottom = top;
    for (std::size_t i = 1; i < n; ++i) {
      top = std::min(top, polygon[i].y());
      bottom = std::max(bottom, polygon[i].y());
    }
    // spans are widened a little so that neighbours leave no gap; the depth test decides
    const double slack = 0.02;
    if (top > camera_.height || bottom < -1) return;
    const int y0 = std::max(0, static_cast<int>(std::ceil(top - slack)));
    const int y1 = std::min(camera_.height - 1, static_cast<int>(std::floor(bottom + slack)));
    for (int y = y0; y <= y1; ++y) {
      const double v = std::min(bottom, std::max(top, static_cast<double>(y)));
      double left = 1e9;
      double right = -1e9;
      for (std::size_t i = 0; i < n; ++i) {
        const Eigen::Vector2d& p = polygon[i];
        const Eigen::Vector2d& q = polygon[(i + 1) % n];
        if ((p.y() < v && q.y() < v) || (p.y() > v && q.y() > v)) continue;
        if (p.y() == q.y()) {
          left = std::min({left, p.x(), q.x()});
          right = std::max({right, p.x(), q.x()});
        } else {
          const double x = p.x() + (v - p.y()) / (q.y() - p.y()) * (q.x() - p.x());
          left = std::min(left, x);
          right = std::max(right, x);
        }
      }
      if (left > camera_.width || right < -1) continue;
      const int x0 = std::max(0, static_cast<int>(std::ceil(left - slack)));
      const int x1 = std::min(camera_.width - 1, static_cast<int>(std::floor(right + slack)));
      // direction along the axis is affine in x, so is the inverse depth
      const float d0 = ray(0, y)[f.axis] / num;
      const float dx = rotation_(f.axis, 0) * ifx_ / num;
      float* z = out.inverse_depth.row(y);
      std::uint16_t* surface = out.surface.row(y);
      const auto id = static_cast<std::uint16_t>(index);
      for (int x = x0; x <= x1; ++x) {
        const float iz = d0 + dx * static_cast<float>(x);
        if (iz > z[x]) {
          z[x] = iz;
          surface[x] = id;
        }
      }
    }
  }

  void draw_limb(std::size_t index, Canvas3d& out) const {
    const LimbBody& b = limbs_[index];
    const auto id = static_cast<std::uint16_t>(scene_.faces.size() + index);
    const Eigen::Vector3f o = b.to_local * (origin_ - b.centre);
    const float c = o.x() * o.x() + o.z() * o.z() - 1;
    if (c < 0 && std::abs(o.y()) < b.half_length + 1) return;  // the camera is inside
    for (int y = b.v0; y <= b.v1; ++y) {
      const Eigen::Vector3f d0 = b.to_local * ray(0, y);
      const Eigen::Vector3f dx = b.to_local * (ifx_ * rotation_.col(0));
      float* z = out.inverse_depth.row(y);
      std::uint16_t* surface = out.surface.row(y);
      for (int x = b.u0; x <= b.u1; ++x) {
        const auto fx = static_cast<float>(x);
        const float ex = d0.x() + fx * dx.x();
        const float ez = d0.z() + fx * dx.z();
        const float a = ex * ex + ez * ez;
        const float h = o.x() * ex + o.z() * ez;
        const float disc = h * h - a * c;
        if (disc < 0) continue;  // misses the endless cylinder
        const float ey = d0.y() + fx * dx.y();
        float t = (-h - std::sqrt(disc)) / (a + 1e-20F);
        const float hit = o.y() + t * ey;
        if (std::abs(hit) > b.half_length) {  // enters through a round end, or not at all
          const float oy = o.y() - (hit > 0 ? b.half_length : -b.half_length);
          const float aa = a + ey * ey;
          const float hh = h + oy * ey;
          const float dd = hh * hh - aa * (c + oy * oy);
          if (dd < 0) continue;
          t = (-hh - std::sqrt(dd)) / aa;
        }
        if (t < kNear) continue;
        const float iz = 1 / t;
        if (iz > z[x]) {
          z[x] = iz;
          surface[x] = id;
        }
      }
    }
  }

  void shade_row(int y, Canvas3d& out) const {
    const float* iz = out.inverse_depth.row(y);
    const std::uint16_t* surface = out.surface.row(y);
    Lanes* colour = out.colour.row(y);
    const int width = camera_.width;
    for (int begin = 0; begin < width;) {
      int end = begin + 1;
      while (end < width && surface[end] == surface[begin]) ++end;
      if (iz[begin] <= 0) {
        for (int x = begin; x < end; ++x) colour[x] = 0;
      } else if (surface[begin] < scene_.faces.size()) {
        shade_face(scene_.faces[surface[begin]], y, begin, end, iz, colour);
      } else {
        shade_limb(limbs_[surface[begin] - scene_.faces.size()], y, begin, end, iz, colour);
      }
      begin = end;
    }
  }

  void shade_face(const Face& f, int y, int begin, int end, const float* iz, Lanes* colour) const {
    const Texture& texture = scene_.textures[static_cast<std::size_t>(f.texture)];
    const Eigen::Vector3f d0 = ray(0, y);
    const Eigen::Vector3f dx = ifx_ * rotation_.col(0);
    const auto sa = static_cast<std::size_t>(f.s_axis);
    const auto ta = static_cast<std::size_t>(f.t_axis);
    const float s0 = (origin_[f.s_axis] - f.low[sa]) * f.density + f.s0;
    const float t0 = (origin_[f.t_axis] - f.low[ta]) * f.density + f.t0;
    const auto shade = static_cast<unsigned>(f.shade * 256.0F);
    const float texels = f.density * ifx_;
    for (int x = begin; x < end; ++x) {
      const auto fx = static_cast<float>(x);
      const float z = 1 / iz[x];
      const float ds = d0[f.s_axis] + fx * dx[f.s_axis];
      const float dt = d0[f.t_axis] + fx * dx[f.t_axis];
      const float dn = d0[f.axis] + fx * dx[f.axis];
      // level of detail of the geometric mean of the two widths of the pixel's footprint
      const float w = z * texels;
      const float w2 = w * w;
      const float lod = 0.25F * rough_log2(w2 * w2 * ((ds * ds + dt * dt + dn * dn) / (dn * dn)));
      const float s = std::max(0.0F, s0 + z * ds * f.density);
      const float t = std::max(0.0F, t0 + z * dt * f.density);
      colour[x] = ((texture.sample(s, t, lod) * shade) >> 8) & kLaneMask;
    }
  }

  void shade_limb(const LimbBody& b, int y, int begin, int end, const float* iz, Lanes* colour) const {
    const Texture& texture = scene_.textures[static_cast<std::size_t>(b.texture)];
    const Eigen::Vector3f light = b.to_world_normal.transpose() * Eigen::Vector3f(-0.35F, -0.8F, -0.5F);
    const Eigen::Vector3f o = b.to_local * (origin_ - b.centre);
    const float texels = b.texels * ifx_;
    for (int x = begin; x < end; ++x) {
      const float z = 1 / iz[x];
      const Eigen::Vector3f q = o + b.to_local * (z * ray(x, y));
      const Eigen::Vector3f n = body_normal(b, q);
      // angle around the axis without trigonometry: [0,4), 0 at the front
      const float sum = std::abs(q.x()) + std::abs(q.z()) + 1e-9F;
      const float turn = q.x() / sum;
      const float angle = q.z() >= 0 ? (q.x() >= 0 ? turn : 4 + turn) : 2 - turn;
      const float s = angle * 64.0F;
      const float t = std::max(0.0F, 128.0F + q.y() * b.row_scale);
      const float lod = rough_log2(z * texels);
      const float lit = n.dot(light) / (b.to_world_normal * n).norm();
      const float shade = 0.62F + 0.38F * std::max(-0.6F, lit);
      colour[x] = ((texture.sample(s, t, lod) * static_cast<unsigned>(shade * 256.0F)) >> 8) & kLaneMask;
    }
  }

  const Scene& scene_;
  const Pinhole& camera_;
  Eigen::Matrix3f rotation_;
  Eigen::Vector3f origin_;
  Pose T_camera_world_;
  float ifx_, ify_, cx_, cy_;
  std::vector<LimbBody> limbs_;
};

}  // namespace testing
APSO_NAMESPACE_END
