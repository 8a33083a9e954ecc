"""`/docs`: the interface as a page that needs nothing from elsewhere."""

from __future__ import annotations

from importlib.resources import files

from fastapi import APIRouter
from fastapi.openapi.docs import get_swagger_ui_html
from fastapi.responses import HTMLResponse
from starlette.routing import Mount
from starlette.staticfiles import StaticFiles

ASSETS = "/docs/assets"

router = APIRouter(include_in_schema=False)


@router.get("/docs", response_class=HTMLResponse)
async def docs() -> HTMLResponse:
    """Swagger UI on this service's own document."""
    return get_swagger_ui_html(
        openapi_url="/openapi.json",
        title="roadprint",
        swagger_js_url=f"{ASSETS}/swagger-ui-bundle.js",
        swagger_css_url=f"{ASSETS}/swagger-ui.css",
        swagger_favicon_url=f"{ASSETS}/favicon.png",
    )


def assets() -> Mount:
    """Swagger UI's own files: a service on a closed network has no other place to get them."""
    return Mount(ASSETS, StaticFiles(directory=str(files("fastapi_offline") / "static")))
