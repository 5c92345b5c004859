/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "view/gpu.h"

#include <stdio.h>
#include <string.h>

#include <epoxy/egl.h>

#define SAMPLES 4

/* ---- context ---- */

static hap_status egl_refuse(hap_detail *detail, const char *what)
{
  if (detail != NULL) {
    snprintf(detail->text, sizeof detail->text,
             "pictures need EGL with OpenGL 3.3: %s (Debian: libegl1 libgl1-mesa-dri)", what);
  }
  return HAP_ERROR_UNSUPPORTED;
}

/* Without a window system where that is there, else the default. */
static EGLDisplay display_open(void)
{
  EGLDisplay display = EGL_NO_DISPLAY;
  if (epoxy_has_egl_extension(EGL_NO_DISPLAY, "EGL_MESA_platform_surfaceless") &&
      epoxy_has_egl_extension(EGL_NO_DISPLAY, "EGL_EXT_platform_base")) {
    display = eglGetPlatformDisplayEXT(EGL_PLATFORM_SURFACELESS_MESA, EGL_DEFAULT_DISPLAY, NULL);
    if (display != EGL_NO_DISPLAY && eglInitialize(display, NULL, NULL)) {
      return display;
    }
  }
  display = eglGetDisplay(EGL_DEFAULT_DISPLAY);
  return display != EGL_NO_DISPLAY && eglInitialize(display, NULL, NULL) ? display : EGL_NO_DISPLAY;
}

hap_status gpu_context_open(gpu_context *out, hap_detail *detail)
{
  static const EGLint wanted[] = {EGL_CONTEXT_MAJOR_VERSION,
                                  3,
                                  EGL_CONTEXT_MINOR_VERSION,
                                  3,
                                  EGL_CONTEXT_OPENGL_PROFILE_MASK,
                                  EGL_CONTEXT_OPENGL_CORE_PROFILE_BIT,
                                  EGL_NONE};
  static const EGLint kind[] = {EGL_SURFACE_TYPE, 0, EGL_RENDERABLE_TYPE, EGL_OPENGL_BIT, EGL_NONE};
  EGLConfig config = NULL;
  EGLint count = 0;
  memset(out, 0, sizeof *out);
  if (!epoxy_has_egl()) {
    return egl_refuse(detail, "libEGL is not there");
  }
  EGLDisplay display = display_open();
  if (display == EGL_NO_DISPLAY) {
    return egl_refuse(detail, "no driver answers");
  }
  out->display = display;
  if (!eglBindAPI(EGL_OPENGL_API) || !eglChooseConfig(display, kind, &config, 1, &count) ||
      count == 0) {
    gpu_context_close(out);
    return egl_refuse(detail, "the driver has no OpenGL");
  }
  out->context = eglCreateContext(display, config, EGL_NO_CONTEXT, wanted);
  if (out->context == EGL_NO_CONTEXT ||
      !eglMakeCurrent(display, EGL_NO_SURFACE, EGL_NO_SURFACE, out->context)) {
    gpu_context_close(out);
    return egl_refuse(detail, "the driver makes no such context without a display");
  }
  return HAP_OK;
}

void gpu_context_close(gpu_context *context)
{
  if (context->display != NULL) {
    eglMakeCurrent(context->display, EGL_NO_SURFACE, EGL_NO_SURFACE, EGL_NO_CONTEXT);
    if (context->context != NULL) {
      eglDestroyContext(context->display, context->context);
    }
    eglTerminate(context->display);
    eglReleaseThread();
  }
  memset(context, 0, sizeof *context);
}

/* ---- surfaces ---- */

static void shadow_make(gpu_surfaces *out)
{
  glGenTextures(1, &out->shadow_map);
  glBindTexture(GL_TEXTURE_2D, out->shadow_map);
  glTexImage2D(GL_TEXTURE_2D, 0, GL_DEPTH_COMPONENT24, out->shadow_pixels, out->shadow_pixels, 0,
               GL_DEPTH_COMPONENT, GL_UNSIGNED_INT, NULL);
  glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MIN_FILTER, GL_LINEAR);
  glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MAG_FILTER, GL_LINEAR);
  glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_WRAP_S, GL_CLAMP_TO_EDGE);
  glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_WRAP_T, GL_CLAMP_TO_EDGE);
  glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_COMPARE_MODE, GL_COMPARE_REF_TO_TEXTURE);
  glGenFramebuffers(1, &out->shadow);
  glBindFramebuffer(GL_FRAMEBUFFER, out->shadow);
  glFramebufferTexture2D(GL_FRAMEBUFFER, GL_DEPTH_ATTACHMENT, GL_TEXTURE_2D, out->shadow_map, 0);
  glDrawBuffer(GL_NONE);
  glReadBuffer(GL_NONE);
}

static void buffer_attach(GLuint buffer, GLenum place, GLenum format, const int size[3])
{
  glBindRenderbuffer(GL_RENDERBUFFER, buffer);
  if (size[2] > 0) {
    glRenderbufferStorageMultisample(GL_RENDERBUFFER, size[2], format, size[0], size[1]);
  } else {
    glRenderbufferStorage(GL_RENDERBUFFER, format, size[0], size[1]);
  }
  glFramebufferRenderbuffer(GL_FRAMEBUFFER, place, GL_RENDERBUFFER, buffer);
}

hap_status gpu_surfaces_make(int width, int height, gpu_surfaces *out, hap_detail *detail)
{
  const int many[3] = {width, height, SAMPLES};
  const int one[3] = {width, height, 0};
  out->shadow_pixels = width > GPU_SHADOW_SMALL ? GPU_SHADOW_LARGE : GPU_SHADOW_SMALL;
  shadow_make(out);
  bool good = glCheckFramebufferStatus(GL_FRAMEBUFFER) == GL_FRAMEBUFFER_COMPLETE;
  glGenRenderbuffers(3, out->buffers);
  glGenFramebuffers(1, &out->many);
  glBindFramebuffer(GL_FRAMEBUFFER, out->many);
  buffer_attach(out->buffers[0], GL_COLOR_ATTACHMENT0, GL_RGBA8, many);
  buffer_attach(out->buffers[1], GL_DEPTH_ATTACHMENT, GL_DEPTH_COMPONENT24, many);
  good = good && glCheckFramebufferStatus(GL_FRAMEBUFFER) == GL_FRAMEBUFFER_COMPLETE;
  glGenFramebuffers(1, &out->one);
  glBindFramebuffer(GL_FRAMEBUFFER, out->one);
  buffer_attach(out->buffers[2], GL_COLOR_ATTACHMENT0, GL_RGBA8, one);
  good = good && glCheckFramebufferStatus(GL_FRAMEBUFFER) == GL_FRAMEBUFFER_COMPLETE;
  return good ? HAP_OK : egl_refuse(detail, "the driver has no surfaces of this size");
}

void gpu_surfaces_free(gpu_surfaces *surfaces)
{
  const GLuint frames[] = {surfaces->many, surfaces->one, surfaces->shadow};
  glDeleteFramebuffers(3, frames);
  glDeleteRenderbuffers(3, surfaces->buffers);
  glDeleteTextures(1, &surfaces->shadow_map);
}

/* ---- programs ---- */

static GLuint shader_compile(GLenum kind, const char *text, hap_detail *detail)
{
  GLuint shader = glCreateShader(kind);
  GLint good = 0;
  glShaderSource(shader, 1, &text, NULL);
  glCompileShader(shader);
  glGetShaderiv(shader, GL_COMPILE_STATUS, &good);
  if (!good && detail != NULL) {
    char log[400] = "";
    glGetShaderInfoLog(shader, sizeof log, NULL, log);
    snprintf(detail->text, sizeof detail->text, "a shader does not compile: %s", log);
  }
  if (!good) {
    glDeleteShader(shader);
  }
  return good ? shader : 0;
}

GLuint gpu_program(const char *vertex, const char *pixel, hap_detail *detail)
{
  GLuint first = shader_compile(GL_VERTEX_SHADER, vertex, detail);
  GLuint second = shader_compile(GL_FRAGMENT_SHADER, pixel, detail);
  GLuint program = 0;
  GLint good = 0;
  if (first != 0 && second != 0) {
    program = glCreateProgram();
    glAttachShader(program, first);
    glAttachShader(program, second);
    glLinkProgram(program);
    glGetProgramiv(program, GL_LINK_STATUS, &good);
  }
  glDeleteShader(first);
  glDeleteShader(second);
  if (program != 0 && !good) {
    glDeleteProgram(program);
    program = 0;
    if (detail != NULL) {
      snprintf(detail->text, sizeof detail->text, "a shader does not link");
    }
  }
  return program;
}

/* ---- meshes ---- */

static const void *buffer_offset(size_t bytes)
{
  return (const void *)bytes;
}

/* The attributes that advance once an instance, from a place of the buffer on. */
static void instances_bind(size_t first)
{
  const GLsizei stride = sizeof(gpu_instance);
  for (GLuint i = 0; i < 4; ++i) {
    glEnableVertexAttribArray(2 + i);
    glVertexAttribPointer(2 + i, 4, GL_FLOAT, GL_FALSE, stride,
                          buffer_offset(first * sizeof(gpu_instance) + i * 4 * sizeof(float)));
    glVertexAttribDivisor(2 + i, 1);
  }
}

void gpu_mesh_make(const shape_mesh *mesh, gpu_mesh *out)
{
  memset(out, 0, sizeof *out);
  out->index_count = (GLsizei)mesh->index_count;
  glGenVertexArrays(1, &out->array);
  glGenBuffers(3, out->buffers);
  glBindVertexArray(out->array);
  glBindBuffer(GL_ARRAY_BUFFER, out->buffers[0]);
  glBufferData(GL_ARRAY_BUFFER, (GLsizeiptr)(mesh->vertex_count * sizeof *mesh->vertices),
               mesh->vertices, GL_STATIC_DRAW);
  for (GLuint i = 0; i < 2; ++i) {
    glEnableVertexAttribArray(i);
    glVertexAttribPointer(i, 3, GL_FLOAT, GL_FALSE, sizeof(shape_vertex),
                          buffer_offset(i * 3 * sizeof(float)));
  }
  glBindBuffer(GL_ELEMENT_ARRAY_BUFFER, out->buffers[1]);
  glBufferData(GL_ELEMENT_ARRAY_BUFFER, (GLsizeiptr)(mesh->index_count * sizeof *mesh->indices),
               mesh->indices, GL_STATIC_DRAW);
}

void gpu_mesh_free(gpu_mesh *mesh)
{
  glDeleteVertexArrays(1, &mesh->array);
  glDeleteBuffers(3, mesh->buffers);
}

void gpu_mesh_load(gpu_mesh *mesh, const gpu_instance *instances, size_t count)
{
  GLsizeiptr bytes = (GLsizeiptr)(count * sizeof *instances);
  glBindBuffer(GL_ARRAY_BUFFER, mesh->buffers[2]);
  if ((GLsizei)count > mesh->capacity) {
    glBufferData(GL_ARRAY_BUFFER, bytes, instances, GL_STREAM_DRAW);
    mesh->capacity = (GLsizei)count;
  } else {
    glBufferSubData(GL_ARRAY_BUFFER, 0, bytes, instances);
  }
}

void gpu_mesh_draw(const gpu_mesh *mesh, size_t first, size_t count)
{
  if (count == 0) {
    return;
  }
  glBindVertexArray(mesh->array);
  glBindBuffer(GL_ARRAY_BUFFER, mesh->buffers[2]);
  instances_bind(first);
  glDrawElementsInstanced(GL_TRIANGLES, mesh->index_count, GL_UNSIGNED_INT, NULL, (GLsizei)count);
}
