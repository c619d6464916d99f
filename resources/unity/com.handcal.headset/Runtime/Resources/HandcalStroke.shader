// Strokes of a constant width in pixels, always in front; see Strokes.cs.
Shader "handcal/Stroke"
{
    Properties
    {
        _Color ("Colour", Color) = (1, 1, 1, 1)
        _WidthPx ("Width, pixels", Float) = 3
        _IsInView ("1: in the axes of the eye's camera", Float) = 0
        _IsHidden ("1: not in this eye", Float) = 0
    }
    SubShader
    {
        Tags { "Queue" = "Overlay" "RenderType" = "Opaque" "DisableBatching" = "True" }
        Cull Off
        ZTest Always
        ZWrite Off
        Pass
        {
            CGPROGRAM
            #pragma vertex vert
            #pragma fragment frag
            #include "UnityCG.cginc"

            fixed4 _Color;
            float _WidthPx;
            float _IsInView;
            float _IsHidden;

            struct Vertex
            {
                float3 end : POSITION;
                float3 other : NORMAL;
                float2 corner : TEXCOORD0;  // which end, which side: -1 or 1
            };

            float4 ToClip(float3 position)
            {
                return _IsInView > 0.5 ? mul(UNITY_MATRIX_P, float4(position, 1)) : UnityObjectToClipPos(position);
            }

            float4 vert(Vertex v) : SV_POSITION
            {
                float4 end = ToClip(v.end);
                float4 other = ToClip(v.other);
                float2 halfPx = 0.5 * _ScreenParams.xy;
                float2 away = (end.xy / end.w - other.xy / other.w) * halfPx;
                float lengthPx = length(away);
                away = lengthPx > 0.01 ? away / lengthPx : float2(v.corner.x, 0);
                float2 aside = float2(-away.y, away.x) * v.corner.x * v.corner.y;
                end.xy += 0.5 * _WidthPx * (away + aside) / halfPx * end.w;
                return _IsHidden > 0.5 ? float4(2, 2, 2, 1) : end;  // outside, without an area
            }

            fixed4 frag() : SV_Target
            {
                return _Color;
            }
            ENDCG
        }
    }
}
