// Strokes of a constant width in pixels, always in front; see Strokes.cs.
Shader "handcal/Stroke"
{
    Properties
    {
        _Color ("Colour", Color) = (1, 1, 1, 1)
        _WidthPx ("Width, pixels", Float) = 3
        _IsInView ("1: in the axes of the eye's camera", Float) = 0
        _Eyes ("Eyes that draw it; 1: left, 2: right, 3: both", Float) = 3
        _Eye ("Eye that is rendered, as 1 or 2; 0: the one that Unity says", Float) = 0
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
            float _Eyes;
            float _Eye;

            struct Vertex
            {
                float3 end : POSITION;
                float3 other : NORMAL;
                float2 corner : TEXCOORD0;  // which end, which side: -1 or 1
                UNITY_VERTEX_INPUT_INSTANCE_ID
            };

            struct Drawn
            {
                float4 position : SV_POSITION;
                UNITY_VERTEX_OUTPUT_STEREO
            };

            float4 ToClip(float3 position)
            {
                return _IsInView > 0.5 ? mul(UNITY_MATRIX_P, float4(position, 1)) : UnityObjectToClipPos(position);
            }

            Drawn vert(Vertex v)
            {
                Drawn drawn;
                UNITY_SETUP_INSTANCE_ID(v);
                UNITY_INITIALIZE_VERTEX_OUTPUT_STEREO(drawn);
                float4 end = ToClip(v.end);
                float4 other = ToClip(v.other);
                float2 halfPx = 0.5 * _ScreenParams.xy;
                float2 away = (end.xy / end.w - other.xy / other.w) * halfPx;
                float lengthPx = length(away);
                away = lengthPx > 0.01 ? away / lengthPx : float2(v.corner.x, 0);
                float2 aside = float2(-away.y, away.x) * v.corner.x * v.corner.y;
                end.xy += 0.5 * _WidthPx * (away + aside) / halfPx * end.w;
                float eye = _Eye > 0.5 ? _Eye : 1 + unity_StereoEyeIndex;
                bool isHidden = abs(_Eyes - 3) > 0.5 && abs(_Eyes - eye) > 0.5;
                drawn.position = isHidden ? float4(2, 2, 2, 1) : end;  // outside, without an area
                return drawn;
            }

            fixed4 frag(Drawn drawn) : SV_Target
            {
                return _Color;
            }
            ENDCG
        }
    }
}
